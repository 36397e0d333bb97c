"""Extremes: simulations at the ends of every parameter's range, held against a check.

The check's equations and their solves, `_check_equations`, `_check_solve` and `_check_gait`, share
nothing with the rest of the package.
"""

from jaxbiped.extremes._case import Case as Case
from jaxbiped.extremes._catalogue import RANGES as RANGES
from jaxbiped.extremes._catalogue import catalogue as catalogue
from jaxbiped.extremes._gaits import GaitCase as GaitCase
from jaxbiped.extremes._gaits import GaitJudge as GaitJudge
from jaxbiped.extremes._gaits import GaitVerdict as GaitVerdict
from jaxbiped.extremes._gaits import gaits as gaits
from jaxbiped.extremes._grazing import Grazing as Grazing
from jaxbiped.extremes._grazing import grazing as grazing
from jaxbiped.extremes._study import by_group as by_group
from jaxbiped.extremes._study import counts as counts
from jaxbiped.extremes._study import reasons as reasons
from jaxbiped.extremes._study import study as study
from jaxbiped.extremes._verdict import VERDICTS as VERDICTS
from jaxbiped.extremes._verdict import Verdict as Verdict
from jaxbiped.extremes._verdict import judge as judge
