"""Laws of contact and rules of clearance: normal forces, friction, bristles.

`parameter` declares a parameter of a law; a `Quantity` describes it. A law enters `NORMAL_LAWS` or
`FRICTION_LAWS` under its `name` when it is defined. The command line offers the laws imported
below, in this order.
"""

from jaxbiped._parameter_declaration import parameter as parameter
from jaxbiped._quantity import Quantity as Quantity
from jaxbiped.scene._clearance import AbstractClearance as AbstractClearance
from jaxbiped.scene._clearance import AlwaysTouching as AlwaysTouching
from jaxbiped.scene._clearance import OneFoot as OneFoot
from jaxbiped.scene._clearance import StanceRotation as StanceRotation
from jaxbiped.scene.laws._abstract_laws import AbstractFrictionLaw as AbstractFrictionLaw
from jaxbiped.scene.laws._abstract_laws import AbstractNormalLaw as AbstractNormalLaw
from jaxbiped.scene.laws._abstract_laws import AbstractBristleLaw as AbstractBristleLaw

# Normal laws.
from jaxbiped.scene.laws.normal._viscoelastic import Hertz as Hertz
from jaxbiped.scene.laws.normal._viscoelastic import KelvinVoigt as KelvinVoigt
from jaxbiped.scene.laws.normal._ristow_schafer import RistowSchafer as RistowSchafer
from jaxbiped.scene.laws.normal._ristow_schafer import SmoothRistowSchafer as SmoothRistowSchafer
from jaxbiped.scene.laws.normal._viscoelastic import KuwabaraKono as KuwabaraKono
from jaxbiped.scene.laws.normal._viscoelastic import Tsuji as Tsuji
from jaxbiped.scene.laws.normal._hunt_crossley import HuntCrossley as HuntCrossley

# Friction laws, those with bristles last.
from jaxbiped.scene.laws.friction._coulomb import Frictionless as Frictionless
from jaxbiped.scene.laws.friction._coulomb import Viscous as Viscous
from jaxbiped.scene.laws.friction._coulomb import RegularisedCoulomb as RegularisedCoulomb
from jaxbiped.scene.laws.friction._coulomb import Threlfall as Threlfall
from jaxbiped.scene.laws.friction._coulomb import Ambrosio as Ambrosio
from jaxbiped.scene.laws.friction._stribeck import Stribeck as Stribeck
from jaxbiped.scene.laws.friction._stribeck import BengisuAkay as BengisuAkay
from jaxbiped.scene.laws.friction._stribeck import SmoothBengisuAkay as SmoothBengisuAkay
from jaxbiped.scene.laws.friction._stribeck import Andersson as Andersson
from jaxbiped.scene.laws.friction._stribeck import BrownMcPhee as BrownMcPhee
from jaxbiped.scene.laws.friction._bristles import Dahl as Dahl
from jaxbiped.scene.laws.friction._bristles import LuGre as LuGre

# What is made of them: behind the laws, whose order the catalogue looks up here.
from jaxbiped.scene.laws._abstract_laws import FRICTION_LAWS as FRICTION_LAWS
from jaxbiped.scene.laws._abstract_laws import NORMAL_LAWS as NORMAL_LAWS
from jaxbiped.scene.laws._catalogue import friction_law_like as friction_law_like
from jaxbiped.scene.laws._catalogue import normal_law_like as normal_law_like
from jaxbiped.scene.laws.normal._viscoelastic import hertz_stiffness as hertz_stiffness
from jaxbiped.scene.laws.normal._hunt_crossley import RESTITUTION_FORMULAS as RESTITUTION_FORMULAS
