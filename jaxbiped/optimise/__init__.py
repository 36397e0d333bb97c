"""Optimisation of gaits: objectives, optimisers, certificates of an optimum."""

from jaxbiped.hybrid._motion_costs import Along as Along
from jaxbiped.hybrid._motion_costs import Extreme as Extreme
from jaxbiped.hybrid._motion_costs import Integral as Integral
from jaxbiped.hybrid._named_costs import NAMED_COSTS as NAMED_COSTS
from jaxbiped.optimise._bifurcation_distance import BifurcationDistance as BifurcationDistance
from jaxbiped.optimise._bifurcation_distance import Sought as Sought
from jaxbiped.optimise._bifurcation_distance import bifurcation_distance as bifurcation_distance
from jaxbiped.optimise._certificate import Certificate as Certificate
from jaxbiped.optimise._certificate import certify as certify
from jaxbiped.optimise._library import library as library
from jaxbiped.optimise._objective_values import Evaluation as Evaluation
from jaxbiped.optimise._objectives import OBJECTIVES as OBJECTIVES
from jaxbiped.optimise._objectives import FunctionOf as FunctionOf
from jaxbiped.optimise._objectives import Linear as Linear
from jaxbiped.optimise._objectives import Objective as Objective
from jaxbiped.optimise._optimality import Curvature as Curvature
from jaxbiped.optimise._optimality import Held as Held
from jaxbiped.optimise._optimality import Optimality as Optimality
from jaxbiped.optimise._optimise_gait import FORMULATIONS as FORMULATIONS
from jaxbiped.optimise._optimisers import OPTIMISERS as OPTIMISERS
from jaxbiped.optimise._optimum import Iteration as Iteration
from jaxbiped.optimise._optimum import Optimum as Optimum
from jaxbiped.optimise._optimum import Outcome as Outcome
from jaxbiped.optimise._optimum_sensitivities import Sensitivities as Sensitivities
from jaxbiped.optimise._pareto_front import ParetoFront as ParetoFront
from jaxbiped.optimise._pareto_front import pareto_front as pareto_front
