"""Design problems whose measures are functions, instead of a walker's."""

import jax
import jax.numpy as jnp
import numpy as np

import jaxbiped as jb
from jaxbiped._progress import stage
from jaxbiped.optimise import Evaluation
from jaxbiped.optimise._design_gaits import GaitSettings
from jaxbiped.optimise._design_problem import DesignProblem, variables_of
from jaxbiped.optimise._objective_values import Evaluations
from jaxbiped.optimise._objectives import measures_named
from jaxbiped.optimise._optimum_sensitivities import sensitivities_of as sensitivities_of
from jaxbiped.optimise._requirements import requirements_of
from jaxbiped.optimise._runs import Runs

SCENE = jb.ladder()["rigid"]
NAMES = jb.parameter_names(SCENE)
NO_STATE = np.zeros(4), np.zeros((4, len(NAMES)))
FASTEST = {"speed": 1.0}, -1.0
BOTH = {"d": (0.04, 0.2), "slope": (0.005, 0.08)}


def difference(function, h=1e-6):
    """The derivative of a function of one number at zero."""
    return (function(h) - function(-h)) / (2.0 * h)


def slopes_of(**slopes):
    """Derivatives with respect to all parameters, from those by name."""
    return np.array([slopes.get(name, 0.0) for name in NAMES])


class Drawn(DesignProblem):
    """By name value and derivatives with respect to the variables; None for a lost gait.

    `errors` are relative to both, unless the function returns errors of both behind them.
    """

    def _follow(self, u):
        told = self.function(self.variables.by_name(u), u)
        if told is None:
            return None
        names, columns = self.variables.names, ([], [], [], [])
        for value, slope, *bars in told.values():
            bars = bars or (self.errors * abs(value), self.errors * np.abs(slope))
            for column, row in zip(columns, (value, bars[0], slope, bars[1]), strict=True):
                is_row = bool(np.ndim(row))
                row = slopes_of(**dict(zip(names, row, strict=True))) if is_row else float(row)
                column.append(row)
        known = Evaluation(*(dict(zip(told, c, strict=True)) for c in columns), *NO_STATE)
        self.evaluations.add(u, known)
        return known

    def _keep(self, u, scene, gait, functionals=None):
        return self._follow(u)


def drawn(function, vary, told, sense=1.0, subject_to=None, *, begin=0.4, errors=0.0, kind=Drawn):
    """A problem of a function of the parameters by name and of u, begun at equal u."""
    held = requirements_of(SCENE, subject_to)
    made = kind(
        jb.with_parameters(SCENE, {"slope": 0.02}), variables_of(SCENE, vary), told, sense,
        held.each, {**measures_named(told), **held.measures}, GaitSettings(), Evaluations(),
    )  # fmt: skip
    made.function, made.errors = function, errors
    made.at(np.full(len(vary), begin))
    return made


BOX = {"d": (0.05, 0.2), "J": (0.003, 0.02), "r": (0.04, 0.12), "m": (1.0, 3.0), "g": (9.0, 10.0)}


def best_of(count, function, goal="speed", subject_to=None, *, begin=0.3, **how):
    """The runs over a function of u whose gradients, and errors of them, are in u."""
    vary = dict(list(BOX.items())[:count])
    rates = variables_of(SCENE, vary).rates

    def told(_, u):
        rows = function(u)
        return rows and {
            name: tuple(part / rates(u) if np.ndim(part) else part for part in row)
            for name, row in rows.items()
        }

    made = drawn(told, vary, {goal: 1.0}, 1.0, subject_to, begin=begin)
    return solved(made, **{"iterations": 300} | how)


def solved(made, iterations=60, optimiser="trust-region"):
    """The runs of a problem from where it was begun."""
    with stage("optimising") as now:
        runs = Runs(made, iterations, optimiser, now)
    runs.run(made.latest)
    return runs


def formulas(d, slope):
    """Measures of a design; d and slope about 0.1 m and 0.02 rad."""
    x, y = jnp.log(d / 0.1), jnp.log(slope / 0.02)
    a, b, c = 0.5 + x + 0.1 * y * y, -(0.5 - x + 0.1 * y * y), 0.1
    return {
        "speed": 1.0 - (x - 0.2) ** 2 - 2.0 * (y - 0.1) ** 2,
        "step_length": 0.2 + 0.1 * x + 0.05 * y,
        "period": 0.5 + 0.1 * y,
        "spectral_radius": jnp.maximum(a, -b),
        "symmetric_1": a + b + c,
        "symmetric_2": a * b + a * c + b * c,
        "symmetric_3": a * b * c,
        "next_modulus": 0.1 + 0.0 * x,
    }


_VALUES, _SLOPES = jax.jit(formulas), jax.jit(jax.jacfwd(formulas, argnums=(0, 1)))


def formula_problem(vary, told, sense, subject_to=None, *, errors=1e-3):
    """Of the formulas, whose error bars are relative; beyond d = 0.19 there is no gait."""

    def function(named, u):
        if named["d"] > 0.19:
            return None
        at = named["d"], named.get("slope", 0.02)
        values, slopes = _VALUES(*at), _SLOPES(*at)
        return {
            name: (value, [dict(zip(BOTH, slopes[name], strict=True)).get(n, 0.0) for n in named])
            for name, value in values.items()
        }

    return drawn(function, vary, told, sense, subject_to, errors=errors)
