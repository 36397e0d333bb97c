"""Continuation of gaits in a parameter: branches, bifurcations, and what branches off there."""

from jaxbiped.continuation._axis import Axis as Axis
from jaxbiped.continuation._bifurcations import BifurcationPoint as BifurcationPoint
from jaxbiped.continuation._bifurcations import BranchEvent as BranchEvent
from jaxbiped.continuation._branch import Branch as Branch
from jaxbiped.continuation._branch_dataset import branch_dataset as branch_dataset
from jaxbiped.continuation._branch_dataset import open_branch as open_branch
from jaxbiped.continuation._branch_point import BranchPoint as BranchPoint
from jaxbiped.continuation._continue_gait import continue_gait as continue_gait
from jaxbiped.continuation._resume_branch import resume_branch as resume_branch
from jaxbiped.continuation._trace import BranchStop as BranchStop
