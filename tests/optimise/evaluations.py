"""What optimisations evaluate at one gait, by name."""

import dataclasses

import numpy as np

import jaxbiped as jb
from jaxbiped.gait._search_starts import default_guess
from jaxbiped.optimise._cycle_costs import cost_functionals
from jaxbiped.optimise._design_gaits import GaitSettings, ensemble_of, evaluate_ensemble
from jaxbiped.optimise._design_problem import DesignProblem, start_of, variables_of
from jaxbiped.optimise._jacobian_functionals import jacobian_functionals
from jaxbiped.optimise._objective_values import Evaluations, evaluate
from jaxbiped.optimise._objectives import measures_named, objective_of
from jaxbiped.optimise._refinement import with_halved_intervals
from jaxbiped.optimise._requirements import requirements_of
from jaxbiped.optimise._simultaneous import Simultaneous


def evaluated(scene, gait, names, accuracy="balanced"):
    """Objectives of a gait with their derivatives with respect to all parameters, and errors."""
    return evaluate(scene, gait, measures_named(names), accuracy)


def evaluated_over_members(scene, gait, names, criterion, larger):
    """The factors of four members that scatter in slope and d, and objectives over them."""
    ensemble = ensemble_of(scene, {"slope": 0.1, "d": 0.05}, 4, criterion, larger, seed=1)
    nominal = evaluated(scene, gait, ())
    wanted = measures_named(names)
    return ensemble.factors, evaluate_ensemble(ensemble, scene, nominal, wanted, GaitSettings())


def named_costs_of(scene, state, names, **how):
    """Costs of the cycle from a state, by name."""
    costs = [cost for name in names for _, cost in jb.optimise.NAMED_COSTS[name].costs(None)]
    values = np.asarray(cost_functionals(scene, state, tuple(costs), **how).values)
    return dict(zip(names, values.tolist(), strict=True))


def of_return_jacobian(scene, state, names, **how):
    """What is a function of the derivatives of the return map at a state."""
    return jacobian_functionals(scene, state, names, **how)


def evaluated_costs(scene, gait, *costs, accuracy="balanced"):
    """Values of costs of a gait's motion, their derivatives, and the errors of these."""
    found = cost_functionals(scene, gait.measures.state, costs, accuracy=accuracy)
    return np.asarray(found.values), np.asarray(found.slopes), np.asarray(found.slope_errors)


def simultaneous_problem(scene, vary, subject_to):
    """The problem whose unknowns are a cycle's segments, its period and a design; and a point."""
    requirements = requirements_of(scene, subject_to)
    measures = measures_named(["torque_squared"]) | requirements.measures
    problem = DesignProblem(
        scene,
        variables_of(scene, vary),
        {"torque_squared": 1.0},
        1.0,
        requirements.each,
        measures,
        GaitSettings(accuracy="tight"),
        Evaluations(),
    )
    whole = Simultaneous(problem, 7)
    return whole, whole.rough_cycle(start_of(scene, problem.variables), default_guess(scene))


def with_other_goal(best, measures):
    """An optimum as if the sum of these measures had been minimised, without requirements."""
    wanted = {}
    for measure in measures:
        name = measure if isinstance(measure, str) else measure.name
        wanted[name] = objective_of(measure, best.scene, "minimise")
    problem = best.problem.variant(best.scene)
    problem.wanted, problem.requirements = wanted, ()
    problem.weights = dict.fromkeys(wanted, 1.0)
    return dataclasses.replace(best, problem=problem)


def finer_spline(law):
    """A spline in time with twice as many intervals."""
    return with_halved_intervals(law)
