"""Continuation of gaits in a parameter: branches, bifurcations, and what branches off there."""

from jaxbiped.continuation._bifurcation_curve import BifurcationCurve as BifurcationCurve
from jaxbiped.continuation._bifurcation_curve import bifurcation_curve as bifurcation_curve
from jaxbiped.continuation._bifurcations import BifurcationPoint as BifurcationPoint
from jaxbiped.continuation._bifurcations import BranchEvent as BranchEvent
from jaxbiped.continuation._branch import Branch as Branch
from jaxbiped.continuation._branch import open_branch as open_branch
from jaxbiped.continuation._branch_point import Axis as Axis
from jaxbiped.continuation._branch_point import BranchPoint as BranchPoint
from jaxbiped.continuation._continue_gait import resume_branch as resume_branch
from jaxbiped.continuation._critical_values import (
    BifurcationSensitivities as BifurcationSensitivities,
)
from jaxbiped.continuation._critical_values import NearestBifurcation as NearestBifurcation
from jaxbiped.continuation._critical_values import (
    bifurcation_sensitivities as bifurcation_sensitivities,
)
from jaxbiped.continuation._critical_values import nearest_bifurcation as nearest_bifurcation
from jaxbiped.continuation._deflation import IsolatedGait as IsolatedGait
from jaxbiped.continuation._deflation import find_isolated as find_isolated
from jaxbiped.continuation._switch_branch import DoublingCascade as DoublingCascade
from jaxbiped.continuation._switch_branch import doubling_cascade as doubling_cascade
from jaxbiped.continuation._switch_branch import switch_branch as switch_branch
from jaxbiped.continuation._trace import BranchStop as BranchStop
