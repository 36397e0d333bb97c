"""Second tangents along a motion that is already known, by lanes."""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.gait._bent import Bent
from jaxbiped.gait._bent_step import Order, Tangents, linear_about, order_of, tangent_step
from jaxbiped.gait._crossings import crossing_of
from jaxbiped.gait._curvature import LONG_AGO
from jaxbiped.gait._field_rates import FieldRates
from jaxbiped.gait._radau import Path
from jaxbiped.gait._system import AbstractSystem
from jaxbiped.lanes._call import call
from jaxbiped.lanes._engine import CompiledProgram
from jaxbiped.lanes._program import Program
from jaxbiped.solve._columns import Seeded, active_leaves

_COUNT = 2
"""Turned tangents: a multiplier's eigenvector has a real and an imaginary part."""


class _Given(NamedTuple):
    """Inputs: parameters, how far each moves, the start, tangents there, how many steps."""

    args: PyTree
    sizes: Any
    t: Any
    state: Any
    turned: Any
    family: Any
    second: Any
    steps: Any


class _Now(NamedTuple):
    """What is carried: the last node, where the motion is, and the tangents there, in order.

    Attributes:
        node: state at the end of the last step, past a switch or not.
        t, state: time and state, on the switch where there was one: `fresh`.
        switched: time of the last switch.
        tangents: see `tangent_step`.
        count: steps taken.
    """

    node: Any
    t: Any
    state: Any
    fresh: Any
    switched: Any
    tangents: Tangents
    count: Any


def along_nodes(
    system: AbstractSystem,
    rates: FieldRates,
    times: Scalar,
    states: Scalar,
    steps: Scalar,
    bent: Bent,
    sizes: Scalar,
) -> Bent:
    """`along_path` by lanes.

    Of the tangents the two turned ones come first, and move no parameter; of the others each moves
    one, by `sizes`, shape (p,). `steps` is how many there are.
    """
    c, p = states.shape[1], sizes.shape[0]
    structure = jtu.tree_structure(rates.args.args)
    compiled = _compiled(system, rates.args.active, structure, rates.structure)
    given = _Given(
        args=rates.args.args,
        sizes=sizes,
        t=times[0],
        state=states[0],
        turned=bent.first[:, :_COUNT].T,
        family=bent.first[:, _COUNT:].T,
        second=jnp.transpose(bent.second, (1, 2, 0)),
        steps=steps,
    )
    tape = jnp.concatenate([times[1:, None], states[1:]], axis=1)
    found, _ = call(compiled, given, tape=tape, quick=True)
    first = jnp.concatenate([found.turned, found.family]).T
    return Bent(first.reshape(c, _COUNT + p), jnp.transpose(found.second, (2, 0, 1)))


@functools.lru_cache(maxsize=256)
def _compiled(
    system: AbstractSystem, active: tuple[int, ...], args: Any, state: Any
) -> CompiledProgram:
    def numbers(*shape: int) -> Any:
        return jax.ShapeDtypeStruct(shape, jnp.float64)

    c, p = state.num_leaves, len(active)
    shapes = _Given(
        jtu.tree_unflatten(args, [numbers()] * args.num_leaves),
        numbers(p),
        numbers(),
        numbers(c),
        numbers(_COUNT, c),
        numbers(p, c),
        numbers(p, _COUNT, c),
        numbers(),
    )
    return CompiledProgram(_BentSolve(system, active, state).program(), shapes)


class _BentSolve:
    """The functions of the program."""

    def __init__(self, system: AbstractSystem, active: tuple[int, ...], structure: Any) -> None:
        self.system, self.active, self.structure = system, active, structure
        # Compiled by itself, it is traced once, not at each of its many uses.
        self.field = jax.jit(system.vector_field)

    def program(self) -> Program:
        """The program: its tape's rows are time and state at the ends of the steps."""
        tape = 1 + self.structure.num_leaves
        return Program(self.start, self.attempt, self.finish, tape=tape)

    def start(self, given: _Given) -> _Now:
        order = self._order(given)
        tangents = Tangents(*(order.sorted(x) for x in (given.turned, given.family, given.second)))
        return _Now(
            node=given.state,
            t=given.t,
            state=given.state,
            fresh=jnp.asarray(False),
            switched=given.t - LONG_AGO,
            tangents=tangents,
            count=jnp.zeros(()),
        )

    def attempt(self, given: _Given, now: _Now, row: Scalar) -> tuple[_Now, Scalar]:
        order, rates = self._order(given), self._rates(given)
        t, node = row[0], row[1:]
        parameters = jnp.stack([jnp.asarray(q) for q in active_leaves(rates.args)])

        def field(y: Any, q: Any) -> list[Scalar]:
            return rates([*y, *q])

        def surfaces(z: Scalar) -> Any:
            c = self.structure.num_leaves
            return self.system.switches(rates.scene(list(z[c:])), rates.state(list(z[:c])))

        crossing = crossing_of(rates, surfaces, now.node, node, parameters)
        end = t - crossing.past
        path = Path(
            before=now.state,
            after=crossing.landed,
            start=now.t,
            span=jnp.maximum(end - now.t, 0.0),
            switched=now.switched,
            fresh=now.fresh,
        )
        linear = linear_about(field, order, path, crossing, parameters)
        tangents = tangent_step(
            field, linear, crossing, now.fresh, given.sizes, parameters, now.tangents
        )
        count = now.count + 1.0
        after = _Now(
            node=node,
            t=end,
            state=crossing.landed,
            fresh=crossing.crossed,
            switched=jnp.where(crossing.crossed, end, now.switched),
            tangents=tangents,
            count=count,
        )
        return after, count >= given.steps

    def finish(self, given: _Given, now: _Now) -> Tangents:
        order = self._order(given)
        return Tangents(*(order.restored(part) for part in now.tangents))

    def _rates(self, given: _Given) -> FieldRates:
        nothing = jnp.zeros((0, 0))
        seeded = Seeded(given.args, nothing, nothing, self.active)
        return FieldRates(self.field, seeded, self.structure)

    def _order(self, given: _Given) -> Order:
        rates = self._rates(given)
        parameters = active_leaves(rates.args)
        return order_of(lambda y, q: rates([*y, *q]), list(given.state), parameters)
