"""Constraint methods in redundant coordinates, linkages, and the algebra of their constraints."""

from jaxbiped.constraints._constraint_method import (
    AbstractConstraintMethod as AbstractConstraintMethod,
)
from jaxbiped.constraints._constraint_method import (
    AbstractProjectingMethod as AbstractProjectingMethod,
)
from jaxbiped.constraints._constraint_method import Constrained as Constrained
from jaxbiped.constraints._constraint_methods import CONSTRAINT_METHODS as CONSTRAINT_METHODS
from jaxbiped.constraints._constraint_methods import Augmented as Augmented
from jaxbiped.constraints._constraint_methods import Baumgarte as Baumgarte
from jaxbiped.constraints._constraint_methods import DirectCorrection as DirectCorrection
from jaxbiped.constraints._constraint_methods import Index1 as Index1
from jaxbiped.constraints._constraint_methods import Index1Augmented as Index1Augmented
from jaxbiped.constraints._constraint_methods import Penalty as Penalty
from jaxbiped.constraints._constraint_methods import Standard as Standard
from jaxbiped.constraints._linkage import ORIENTATIONS as ORIENTATIONS
from jaxbiped.constraints._linkage import Body as Body
from jaxbiped.constraints._linkage import Joint as Joint
from jaxbiped.constraints._linkage import Linkage as Linkage
