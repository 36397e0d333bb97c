"""Slopes of a rigid walk: how heel strikes and end depend on its start and its scene."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._ending import Ending
from jaxbiped._types import Scalar, select
from jaxbiped.compiler import host_jit
from jaxbiped.dynamics._impact import impact
from jaxbiped.dynamics._rolling import rolling_field
from jaxbiped.dynamics._state import RigidState
from jaxbiped.scene._scene import RigidScene
from jaxbiped.simulate._slopes import LOOSER, Slopes
from jaxbiped.solve._accuracy import Precision
from jaxbiped.solve._failure_events import FALL_ANGLE
from jaxbiped.solve.rosenbrock._rodas5p import Rodas5P
from jaxbiped.variational._tangents import Tangents, along_columns, as_columns
from jaxbiped.variational._tangents_at_times import (
    EventMotion,
    follow_event,
    seeded_directions,
    tangents_after,
)
from jaxbiped.variational._variational_problem import Watch

_WATCH = Watch(field=rolling_field, switches=lambda args, y: ())


class _Strike(NamedTuple):
    """A heel strike's time and the state after it, with their derivatives."""

    t: Scalar
    time: Scalar
    after: Tangents


@host_jit()
def rigid_slopes_of(
    scene: RigidScene,
    state: RigidState,
    strikes: Scalar,
    count: Scalar,
    end: Scalar,
    ending: Scalar,
    *,
    until: Scalar,
    rtol: Scalar,
    places: tuple[int, ...],
    active: tuple[int, ...],
) -> Slopes:
    """Derivatives with respect to some leaves of the state and of the scene.

    Args:
        scene, state: what walked, and from where.
        strikes: times of heel strikes [s], of which the first `count` came; NaN is told where
            there were more.
        count: how many there were.
        end, ending: when and how the walk ended.
        until: its duration [s].
        rtol: relative tolerance of the walk.
        places, active: of the leaves that are differentiated.
    """
    scene, state = jtu.tree_map(lambda leaf: jnp.asarray(leaf, jnp.float64), (scene, state))
    start, seeded = seeded_directions(scene, state, places, active)
    precision, solver = Precision(rtol, LOOSER * rtol), Rodas5P()
    unit = jnp.sqrt(scene.walker.l / scene.ground.g)
    n = len(places) + len(active)

    def follow(since: _Strike, t: Scalar) -> Tangents:
        """With derivatives at this very time."""
        found = tangents_after(_WATCH, solver, since.after, seeded, t - since.t, precision)
        velocity = as_columns(rolling_field(0.0, found.state, scene))
        return found._replace(columns=found.columns - velocity[:, None] * since.time)

    def event(surface: PyTree, at: Tangents) -> EventMotion:
        return follow_event(
            surface, lambda a, y: rolling_field(0.0, y, a), at, seeded, rtol=rtol, unit=unit
        )

    def strike(before: _Strike, given: tuple[Scalar, Scalar]) -> tuple[_Strike, _Strike]:
        t, comes = given
        at = follow(before, jnp.where(comes, t, before.t))
        moves = event(lambda a, y: -(y.theta_1 + y.theta_2), at)
        # This solve's own strike, lest its phase drift away from the walk's.
        rates = rolling_field(0.0, at.state, scene)
        on = jtu.tree_map(lambda leaf, rate: leaf + rate * moves.delay, at.state, rates)
        after, columns = along_columns(
            lambda y, a: impact(a, y).state, Tangents(on, moves.state.T), seeded
        )
        found = _Strike(t + moves.delay, moves.time, Tangents(after, as_columns(columns)))
        found = select(comes, found, before)
        return found, found

    first = _Strike(jnp.zeros_like(end), jnp.zeros(n), Tangents(state, start))
    reached = jnp.arange(len(strikes)) < count
    last, each = jax.lax.scan(strike, first, (strikes, reached))
    at = follow(last, end)

    def fallen(a: RigidScene, y: RigidState) -> Scalar:
        forward = ending == int(Ending.FELL_FORWARD)
        return jnp.where(forward, -y.theta_2, y.theta_2) - FALL_ANGLE

    moves = event(fallen, at)
    struck = (count > 0) & (end <= strikes[jnp.maximum(count - 1, 0)])
    by_clock = ~struck & (end >= until)
    lost = jnp.where(count > len(strikes), jnp.nan, 0.0)
    time = jnp.where(struck, last.time, jnp.where(by_clock, 0.0, moves.time)) + lost
    columns = jnp.where(by_clock, at.columns.T, moves.state)
    columns = jnp.where(struck, last.after.columns.T, columns) + lost
    rates = as_columns(rolling_field(0.0, at.state, scene))
    return Slopes(
        time=jnp.append(jnp.where(reached[:, None], each.time, 0.0), time[None], 0),
        state=jnp.append(
            jnp.where(reached[:, None, None], jnp.swapaxes(each.after.columns, 1, 2), 0.0),
            columns[None],
            0,
        ),
        clock=jnp.append(jnp.zeros(len(strikes)), jnp.where(by_clock, 1.0, 0.0)),
        rates=jnp.broadcast_to(rates, (len(strikes) + 1, len(rates))),
    )
