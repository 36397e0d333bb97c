"""jaxbiped: differentiable simulation of passive biped walkers in JAX.

This page is the map: every public name is exported here and nowhere else. Pictures live in
`jaxbiped.plot`, which needs matplotlib and is not imported with the rest.

Importing jaxbiped switches JAX to 64-bit floats: contact this stiff cannot do with less.
"""

from jaxbiped import _clock as _clock

import jax as _jax

_jax.config.update("jax_enable_x64", True)

from jaxbiped._checks import ArgumentError as ArgumentError
from jaxbiped.dynamics._bristles import BristleState as BristleState
from jaxbiped.dynamics._energy import Energies as Energies
from jaxbiped.dynamics._energy import Powers as Powers
from jaxbiped.dynamics._energy import energies as energies
from jaxbiped.dynamics._energy import powers as powers
from jaxbiped.dynamics._feet import Feet as Feet
from jaxbiped.dynamics._feet import Foot as Foot
from jaxbiped.dynamics._feet import feet as feet
from jaxbiped.dynamics._feet import standing_height as standing_height
from jaxbiped.dynamics._feet import touches as touches
from jaxbiped.dynamics._forces import FootForce as FootForce
from jaxbiped.dynamics._forces import FootForces as FootForces
from jaxbiped.dynamics._forces import foot_forces as foot_forces
from jaxbiped.dynamics._motion import Accelerations as Accelerations
from jaxbiped.dynamics._motion import accelerations as accelerations
from jaxbiped.dynamics._motion import vector_field as vector_field
from jaxbiped.dynamics._state import State as State
from jaxbiped.dynamics._state import exchange_legs as exchange_legs
from jaxbiped.dynamics._state import seed_state as seed_state
from jaxbiped.dynamics._switches import Switch as Switch
from jaxbiped.dynamics._switches import switches as switches
from jaxbiped.gait._dataset import trajectory_dataset as trajectory_dataset
from jaxbiped.gait._footsteps import Footsteps as Footsteps
from jaxbiped.gait._footsteps import HeelStrikes as HeelStrikes
from jaxbiped.gait._footsteps import footsteps as footsteps
from jaxbiped.gait._footsteps import heel_strikes as heel_strikes
from jaxbiped.gait._find_gaits import Gaits as Gaits
from jaxbiped.gait._find_gaits import find_gaits as find_gaits
from jaxbiped.gait._find_gaits import rolling_starts as rolling_starts
from jaxbiped.gait._gait import Gait as Gait
from jaxbiped.gait._gait import Measures as Measures
from jaxbiped.gait._find_gait import find_gait as find_gait
from jaxbiped.gait._gait_measures import gait_measures as gait_measures
from jaxbiped.gait._gradient import AbstractGradient as AbstractGradient
from jaxbiped.gait._gradient import Forward as Forward
from jaxbiped.gait._gradient import Implicit as Implicit
from jaxbiped.gait._gradient import Reverse as Reverse
from jaxbiped.gait._ledger import EnergyLedger as EnergyLedger
from jaxbiped.gait._ledger import energy_ledger as energy_ledger
from jaxbiped.scene._parameters import parameter_names as parameter_names
from jaxbiped.scene._parameters import with_parameters as with_parameters
from jaxbiped.gait._return_map import Return as Return
from jaxbiped.gait._return_map import return_map as return_map
from jaxbiped.gait._search import Search as Search
from jaxbiped.dynamics._impact import Impact as Impact
from jaxbiped.dynamics._impact import impact as impact
from jaxbiped.dynamics._rigid_checks import RigidChecks as RigidChecks
from jaxbiped.dynamics._rigid_checks import rigid_checks as rigid_checks
from jaxbiped.dynamics._rigid_state import RigidState as RigidState
from jaxbiped.dynamics._rigid_state import rigid_state as rigid_state
from jaxbiped.dynamics._rigid_state import whole_state as whole_state
from jaxbiped.dynamics._rolling import RollingMotion as RollingMotion
from jaxbiped.dynamics._rolling import rolling as rolling
from jaxbiped.dynamics._rolling import rolling_field as rolling_field
from jaxbiped.dynamics._section import AbstractSection as AbstractSection
from jaxbiped.dynamics._section import HeelStrike as HeelStrike
from jaxbiped.dynamics._section import MidStance as MidStance
from jaxbiped.dynamics._section import Section as Section
from jaxbiped.gait._stability import Bifurcation as Bifurcation
from jaxbiped.gait._system import AbstractSystem as AbstractSystem
from jaxbiped.gait._system import Rolling as Rolling
from jaxbiped.gait._system import Walking as Walking
from jaxbiped.scene._ambrosio import Ambrosio as Ambrosio
from jaxbiped.scene._andersson import Andersson as Andersson
from jaxbiped.lanes._count import operation_counts as operation_counts
from jaxbiped.scene._bengisu_akay import BengisuAkay as BengisuAkay
from jaxbiped.scene._brown_mcphee import BrownMcPhee as BrownMcPhee
from jaxbiped.scene._catalogue import FRICTION_LAWS as FRICTION_LAWS
from jaxbiped.scene._catalogue import NORMAL_LAWS as NORMAL_LAWS
from jaxbiped.scene._catalogue import friction_law_like as friction_law_like
from jaxbiped.scene._catalogue import normal_law_like as normal_law_like
from jaxbiped.scene._bristle_law import AbstractBristleLaw as AbstractBristleLaw
from jaxbiped.scene._clearance import AbstractClearance as AbstractClearance
from jaxbiped.scene._clearance import AlwaysTouching as AlwaysTouching
from jaxbiped.scene._clearance import OneFoot as OneFoot
from jaxbiped.scene._clearance import StanceRotation as StanceRotation
from jaxbiped.scene._coulomb import RegularisedCoulomb as RegularisedCoulomb
from jaxbiped.scene._dahl import Dahl as Dahl
from jaxbiped.scene._frictionless import Frictionless as Frictionless
from jaxbiped.scene._ground import Ground as Ground
from jaxbiped.scene._hertz import Hertz as Hertz
from jaxbiped.scene._hertz import hertz_stiffness as hertz_stiffness
from jaxbiped.scene._hunt_crossley import HuntCrossley as HuntCrossley
from jaxbiped.scene._kelvin_voigt import KelvinVoigt as KelvinVoigt
from jaxbiped.scene._kuwabara_kono import KuwabaraKono as KuwabaraKono
from jaxbiped.scene._ladder import ladder as ladder
from jaxbiped.scene._law import AbstractFrictionLaw as AbstractFrictionLaw
from jaxbiped.scene._law import AbstractNormalLaw as AbstractNormalLaw
from jaxbiped.scene._restitution import RESTITUTION_FORMULAS as RESTITUTION_FORMULAS
from jaxbiped.scene._rigid_scene import RigidScene as RigidScene
from jaxbiped.scene._lugre import LuGre as LuGre
from jaxbiped.scene._ristow_schafer import RistowSchafer as RistowSchafer
from jaxbiped.scene._scene import Scene as Scene
from jaxbiped.scene._seed import seed_scene as seed_scene
from jaxbiped.scene._smooth_bengisu_akay import SmoothBengisuAkay as SmoothBengisuAkay
from jaxbiped.scene._smooth_ristow_schafer import SmoothRistowSchafer as SmoothRistowSchafer
from jaxbiped.scene._stribeck import Stribeck as Stribeck
from jaxbiped.scene._threlfall import Threlfall as Threlfall
from jaxbiped.scene._tsuji import Tsuji as Tsuji
from jaxbiped.scene._viscous import Viscous as Viscous
from jaxbiped.scene._walker import Walker as Walker
from jaxbiped.solve._accuracy import ACCURACIES as ACCURACIES
from jaxbiped.solve._accuracy import rms_norm as rms_norm
from jaxbiped.solve._ending import Ending as Ending
from jaxbiped.solve._engine import ENGINES as ENGINES
from jaxbiped.solve._rodas3p import Rodas3P as Rodas3P
from jaxbiped.solve._rodas4 import Rodas4 as Rodas4
from jaxbiped.solve._rodas4p import Rodas4P as Rodas4P
from jaxbiped.solve._rodas5p import Rodas5P as Rodas5P
from jaxbiped.solve._rosenbrock import AbstractRosenbrock as AbstractRosenbrock
from jaxbiped.solve._rosenbrock import RosenbrockInterpolation as RosenbrockInterpolation
from jaxbiped.solve._rosenbrock import RosenbrockTableau as RosenbrockTableau
from jaxbiped.simulate._rigid_walk import RigidWalked as RigidWalked
from jaxbiped.simulate._rigid_walk import rigid_walk as rigid_walk
from jaxbiped.simulate._simulate import CompiledSimulation as CompiledSimulation
from jaxbiped.simulate._simulate import Simulation as Simulation
from jaxbiped.simulate._simulate import simulate as simulate
from jaxbiped.solve._solvers import SOLVERS as SOLVERS
from jaxbiped.solve._trajectory import Trajectory as Trajectory
