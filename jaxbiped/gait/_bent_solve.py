"""Second tangents along a motion that is already known, by lanes."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.gait._bent import Bent, renewed
from jaxbiped.gait._bent_step import Order, Tangents, linear_about, order_of, tangent_step
from jaxbiped.gait._crossings import crossing_of
from jaxbiped.gait._curvature import LONG_AGO, SETTLED
from jaxbiped.gait._flow import Arrival, Flow
from jaxbiped.gait._radau import Path
from jaxbiped.gait._system import AbstractSystem
from jaxbiped.lanes._call import call
from jaxbiped.lanes._engine import CompiledProgram
from jaxbiped.lanes._program import Program
from jaxbiped.solve._columns import Seeded, active_leaves
from jaxbiped.solve._passage import Nodes

_COUNT = 2
"""Turned tangents: a multiplier's eigenvector has a real and an imaginary part."""


class _Given(NamedTuple):
    """Inputs: parameters, how far each moves, the start, tangents there, how many steps.

    And time and state at the `last` one's end, in place of the tape's.
    """

    args: PyTree
    sizes: Any
    t: Any
    state: Any
    turned: Any
    family: Any
    second: Any
    steps: Any
    last: Any


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
    flow: Flow,
    nodes: Nodes,
    bent: Bent,
    sizes: Scalar,
    *,
    final: bool,
) -> tuple[Bent, Scalar]:
    """`along_path` and `renewed` by lanes.

    Of the tangents the two turned ones come first, and move no parameter; of the others each moves
    one, by `sizes`, shape (p,). The motion ends at the arrival, not at the last node, and begins
    and ends before its section: that may be a switch, as touchdown is.
    """
    given = _Given(
        args=flow.args.args,
        sizes=sizes,
        t=nodes.start[0],
        state=nodes.start[1:],
        turned=bent.first[:, :_COUNT].T,
        family=bent.first[:, _COUNT:].T,
        second=jnp.transpose(bent.second, (1, 2, 0)),
        steps=nodes.steps,
        last=nodes.arrival,
    )
    args = jtu.tree_structure(flow.args.args)
    compiled = _compiled(flow.system, flow.arrival, flow.args.active, args, flow.structure, final)
    return call(compiled, given, tape=nodes.ends, quick=True)[0]


@functools.lru_cache(maxsize=256)
def _compiled(
    system: AbstractSystem,
    arrival: Arrival,
    active: tuple[int, ...],
    args: Any,
    state: Any,
    final: bool,
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
        numbers(1 + c),
    )
    # Compiled by itself, the field is traced once, not at each of its many uses.
    field = jax.jit(system.vector_field)

    def flow(given: _Given) -> Flow:
        nothing = jnp.zeros((0, 0))
        return Flow(system, arrival, field, Seeded(given.args, nothing, nothing, active), state)

    return CompiledProgram(_BentSolve(flow, 1 + c, final).program(), shapes)


class _BentSolve:
    """The functions of the program: its tape's rows are time and state at the ends of steps."""

    def __init__(self, flow: Callable[[_Given], Flow], row: int, final: bool) -> None:
        self.flow, self.row, self.final = flow, row, final

    def program(self) -> Program:
        """The program."""
        return Program(self.start, self.attempt, self.finish, tape=self.row)

    def start(self, given: _Given) -> _Now:
        order = self._order(given)
        row = jnp.concatenate([given.t[None], given.state])
        t, state = _cut(self.flow(given).earlier(row, self._parameters(given)))
        tangents = Tangents(*(order.sorted(x) for x in (given.turned, given.family, given.second)))
        return _Now(
            node=state,
            t=t,
            state=state,
            fresh=jnp.asarray(False),
            switched=t - LONG_AGO,
            tangents=tangents,
            count=jnp.zeros(()),
        )

    def attempt(self, given: _Given, now: _Now, row: Scalar) -> tuple[_Now, Scalar]:
        flow, order, parameters = self.flow(given), self._order(given), self._parameters(given)
        count = now.count + 1.0
        last = flow.earlier(given.last, parameters)
        t, node = _cut(jnp.where(count >= given.steps, last, row))

        def field(y: Any, q: Any) -> list[Scalar]:
            return flow([*y, *q])

        crossing = crossing_of(flow, flow.surfaces, now.node, node, parameters)
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
        over = count >= given.steps
        after = _Now(
            node=node,
            t=end,
            state=crossing.landed,
            fresh=crossing.crossed,
            switched=jnp.where(crossing.crossed, end, now.switched),
            tangents=tangents,
            count=count,
        )
        early = (end - now.switched < SETTLED) & ~crossing.crossed & ~over
        waiting = now._replace(node=node, count=count)
        return jax.tree.map(lambda a, b: jnp.where(early, a, b), waiting, after), over

    def finish(self, given: _Given, now: _Now) -> tuple[Bent, Scalar]:
        """Tangents after the arrival, and the time's second ones."""
        order, parameters = self._order(given), self._parameters(given)
        tangents = Tangents(*(order.restored(part) for part in now.tangents))
        bent = Bent(
            jnp.concatenate([tangents.turned, tangents.family]).T,
            jnp.transpose(tangents.second, (2, 0, 1)),
        )
        seeds = jnp.concatenate([jnp.zeros((len(parameters), _COUNT)), jnp.diag(given.sizes)], 1)
        z = jnp.concatenate([now.node, parameters])
        return renewed(self.flow(given), z, bent, seeds, _COUNT, final=self.final, each=_one_by_one)

    def _parameters(self, given: _Given) -> Scalar:
        return jnp.stack([jnp.asarray(q) for q in active_leaves(self.flow(given).args)])

    def _order(self, given: _Given) -> Order:
        flow = self.flow(given)
        return order_of(
            lambda y, q: flow([*y, *q]), list(given.state), list(self._parameters(given))
        )


def _cut(row: Scalar) -> tuple[Scalar, Scalar]:
    """The time and the components."""
    return row[0], row[1:]


def _one_by_one(function: Callable[[Scalar], Scalar]) -> Callable[[Scalar], Scalar]:
    return lambda matrix: jax.lax.map(function, matrix.T).T
