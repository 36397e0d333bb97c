"""Variational problem and solution: what a solve with derivatives takes and gives."""

from typing import NamedTuple

from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.solve._units import Units


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
