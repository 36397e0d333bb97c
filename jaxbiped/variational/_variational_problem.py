"""Variational problem: what a solve with derivatives watches, takes and gives."""

import functools
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar, VectorField
from jaxbiped.dynamics._switches import Switch
from jaxbiped.solve._units import Units

_ROUNDING = 1e-12


class Watch(eqx.Module):
    """What a solve ends steps on, and what ends it. All functions take (args, state).

    Attributes:
        field: vector field (t, state, args).
        switches: the surfaces that no step may straddle.
        section: value and whether a crossing counts; the solve ends where the value rises through
            zero and it does. None: nothing to arrive at.
        ending: code of the failure that ends the solve, 0 for none.
        peak: a quantity whose largest value is to be known.
    """

    field: VectorField = eqx.field(static=True)
    switches: Callable[[PyTree, PyTree], tuple[Switch, ...]] = eqx.field(static=True)
    section: Callable[[PyTree, PyTree], tuple[Scalar, Scalar]] | None = eqx.field(
        static=True, default=None
    )
    ending: Callable[[PyTree, PyTree], Scalar] | None = eqx.field(static=True, default=None)
    peak: Callable[[PyTree, PyTree], PyTree] | None = eqx.field(static=True, default=None)


def surfaces_of(watch: Watch, peak: PyTree, scene: PyTree, state: PyTree) -> list[Switch]:
    """Every surface to end steps on: switches, the peak quantity's maxima, and last the section."""
    found = list(watch.switches(scene, state))
    if watch.peak is not None:
        rate = watch.field(jnp.zeros_like(peak), state, scene)
        quantity = functools.partial(watch.peak, scene)
        value, slope = jax.jvp(quantity, (state,), (rate,))
        # The same value computed twice may differ by its rounding.
        found.append(Switch(slope, value >= peak - _ROUNDING * jnp.abs(peak)))
    if watch.section is not None:
        found.append(Switch(*watch.section(scene, state)))
    return found


class VariationalProblem(NamedTuple):
    """One solve's inputs. Of n directions, m are of the state and p of parameters.

    Attributes:
        args, state: parameters and start, pytrees of scalars.
        by_state: columns of the first m directions, shape (m, c).
        by_parameter: of the others, shape (p, c).
        sizes: by how much these move their parameter, shape (p,).
        carries_parameters: whether these are carried at all (0 or 1).
        state_floors, parameter_floors: below which errors of columns are absolute, (m,) and (p,).
        rtol, tangent_rtol: tolerances of state and columns.
        units: of the state's leaves and of time.
        max_time: longest time to the section [s]; from `almost` on, a step there ends there.
        max_attempts: cap on attempted steps.
    """

    args: PyTree
    state: PyTree
    by_state: Scalar
    by_parameter: Scalar
    sizes: Scalar
    carries_parameters: Scalar
    state_floors: Scalar
    parameter_floors: Scalar
    rtol: Scalar
    tangent_rtol: Scalar
    units: Units
    max_time: Scalar
    almost: Scalar
    max_attempts: Scalar


class VariationalSolution(NamedTuple):
    """What a solve found: as in `SectionArrival`, all columns as rows of shape (m + p, …).

    Attributes:
        t, state, columns, time_columns: on the section.
        code, attempted, jumps, grazes, peak, peak_columns: see there.
        accepted: number of steps accepted.
    """

    t: Scalar
    state: PyTree
    columns: Scalar
    time_columns: Scalar
    code: Scalar
    attempted: Scalar
    accepted: Scalar
    jumps: Scalar
    grazes: Scalar
    peak: Scalar
    peak_columns: Scalar

    @property
    def undetermined(self) -> Scalar:
        """Whether the columns are not the derivatives of the motion (boolean)."""
        return self.grazes > 0
