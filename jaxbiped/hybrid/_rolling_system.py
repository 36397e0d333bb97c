"""Rolling: the walker on rigid feet as a landing system, with impacts and changes of mode."""

from collections.abc import Callable, Collection
from functools import partial
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np

from jaxbiped._ending import Ending
from jaxbiped._types import Scalar, Time
from jaxbiped.dynamics._holds import gap_of, on_held
from jaxbiped.dynamics._impact import impact
from jaxbiped.dynamics._joint_loads import of_all_bodies
from jaxbiped.dynamics._mode_changes import (
    SLACK,
    change_mode,
    change_mode_on_surface,
    foot_loads,
    held_reactions,
    loose_limits,
)
from jaxbiped.dynamics._stance import Stance, of_stance, stance_on
from jaxbiped.dynamics._stance_motion import (
    ground_force,
    rolling,
    rolling_field,
    rolling_rates,
    turning_of,
)
from jaxbiped.dynamics._surfaces import lead, lean, opening, straight_legs, uprightness
from jaxbiped.hybrid._guards import Switch
from jaxbiped.hybrid._landing_system import AbstractLandingSystem
from jaxbiped.hybrid._sections import AbstractSection, check_section_body
from jaxbiped.hybrid._start_placement import held_like, passes_a_stop
from jaxbiped.hybrid._walker_starts import rolling_start
from jaxbiped.hybrid._walker_system import AbstractWalkerSystem
from jaxbiped.scene._modes import rigid_modes
from jaxbiped.scene._scene import RigidScene
from jaxbiped.scene._state_types import CLOCK

_LANDED = 1e-3
"""How near a landing comes to where a load is zero, in units of the tolerance."""


class Rolling(AbstractLandingSystem, AbstractWalkerSystem):
    """The rigid walker: it rolls on one foot, and exchanges support at each heel strike.

    Of the place along the slope, steps carry that of the standing foot at its body's angle 0, which
    changes where another foot stands; the root point's follows from the angles.
    """

    cyclic_coordinates: ClassVar[tuple[int, ...]] = (0,)
    refuses: ClassVar[tuple[str, ...]] = ("atol", "adjoint")
    endings: ClassVar[tuple[Ending, ...]] = (Ending.FELL_FORWARD, Ending.FELL_BACK)

    accelerations = staticmethod(rolling_rates)
    arrival_surface = staticmethod(opening)
    arrival_counts = staticmethod(lead)

    def start(self, args: RigidScene, y: Any) -> tuple[Any, None]:
        return rolling_start(args, y), None

    def check_section(self, args: RigidScene, section: AbstractSection) -> None:
        check_section_body(args, section)

    def vector_field(self, t: Time, y: Any, args: RigidScene) -> Any:
        return rolling_field(t, y, args)

    def positions(self, args: RigidScene) -> slice:
        return slice(1, 1 + len(args.mechanism.structure.free))

    def time_scale(self, args: RigidScene) -> Scalar:
        return jnp.sqrt(args.mechanism.height / args.ground.g)

    def switches(self, args: RigidScene, y: Any) -> tuple[Switch, ...]:
        """Where the mode changes: gaps and reactions of limits, heights and loads of two feet.

        Values are in rad, heights in units of the walker's, and loads in units of its weight too.
        """
        mechanism, modes = args.mechanism, rigid_modes(args.mechanism)
        if not modes.any:
            return ()
        weight = mechanism.total_mass * args.ground.g
        mode = modes.decoded(jnp, y.mode)

        def gaps_and_reactions(stance: Stance) -> list[Scalar]:
            reactions = held_reactions(stance, turning_of(args, stance))
            gaps = [gap_of(args, limit, stance) for limit in modes.limits]
            return [*gaps, *(each / (weight * mechanism.height) for each in reactions)]

        pressed = [a & b for a, b in zip(mode.held, loose_limits(modes, mode), strict=True)]
        live = [*(~held for held in mode.held), *pressed]
        values = of_stance(args, y, gaps_and_reactions) if modes.limits else []
        found = [_falls(*each) for each in zip(values, live, strict=True)]
        for leg, flat in modes.flat(mode).items():
            stance, here = stance_on(args, y, leg), modes.stands_on(mode, leg)
            for k, stands in zip(stance.feet, stance.stands, strict=True):
                found.append(_falls(stance.height(k) / mechanism.height, here & ~stands))
            loads = foot_loads(args, stance, turning_of(args, stance))
            found += [_falls(load / weight, flat) for load in loads]
        return tuple(found)

    def bends_of_gaps(self, args: RigidScene, accelerations: tuple[Scalar, ...]) -> list[Scalar]:
        turning = of_all_bodies(args.mechanism.structure, accelerations, accelerations[0])
        return [limit.gap.of(turning) for limit in rigid_modes(args.mechanism).limits]

    def changes_mode(self, args: RigidScene) -> bool:
        return rigid_modes(args.mechanism).may_change

    def change_mode(self, args: RigidScene, y: Any, rtol: Scalar | None = None) -> Any:
        if rtol is None:
            return change_mode(args, y)
        slack = jnp.maximum(SLACK, rtol)
        return change_mode(args, y, slack, _LANDED * slack)

    def reset_at_switch(self, args: RigidScene, y: Any, which: Scalar) -> Any:
        return change_mode_on_surface(args, y)

    def lies_beyond(self, args: RigidScene, states: Any, by: float = SLACK) -> np.ndarray:
        return passes_a_stop(args, states._asdict(), by=by)

    def placed_like(self, args: RigidScene, base: Any, states: Any, named: Collection[str]) -> Any:
        return held_like(args, base, states, named)

    def strike_places(self, args: RigidScene, states: Any, count: int) -> Scalar:
        """Places of the standing foot just after the strikes [m], shape (count,)."""
        begins = jtu.tree_map(lambda x: x[:, 0], states)
        return begins[0] + jax.vmap(partial(self.foot_ahead, args))(begins)

    def on_held(self, args: RigidScene, y: Any) -> Any:
        return on_held(args, y)

    def ending(self, args: RigidScene, y: Any) -> Scalar:
        """The root point comes down as a compliant walker's does."""
        side = jnp.sign(lean(args, y))
        fallen = jnp.where(side < 0.0, int(Ending.FELL_FORWARD), int(Ending.FELL_BACK))
        code = jnp.where(uprightness(args, y, side) < 0.0, fallen, 0)
        return jnp.where(jnp.isfinite(sum(y)), code, int(Ending.SOLVER_FAILED))

    def surface_of_ending(self, args: RigidScene, near: Any) -> Callable[[Any], Scalar]:
        return partial(uprightness, args, side=jnp.sign(lean(args, near)))

    def ending_on_surface(self, args: RigidScene, y: Any) -> Scalar:
        forward = lean(args, y) < 0.0
        return jnp.where(forward, int(Ending.FELL_FORWARD), int(Ending.FELL_BACK))

    def ending_stays(self, args: RigidScene) -> bool:
        # A walker with bent legs that has fallen may lean to the other side.
        return straight_legs(args.mechanism) is not None

    def arrival(self, section: AbstractSection, args: RigidScene, y: Any) -> tuple[Scalar, Scalar]:
        # The angles before the impact tell, without it.
        return -opening(args, y), lead(args, y) > 0.0

    def later(self, args: RigidScene, y: Any, time: Callable[[], Scalar]) -> Any:
        return y._replace(clock=y.clock + time()) if CLOCK in y._fields else y

    def reset_map(self, args: RigidScene, y: Any) -> Any:
        return impact(args, y).state

    def carried(self, args: RigidScene, y: Any) -> Any:
        return _shifted(y, -_root_place(args, y))

    def completed(self, args: RigidScene, y: Any) -> Any:
        return _shifted(y, _root_place(args, y))

    def in_place(
        self, args: RigidScene, before: Any, y: Any, is_reset: Scalar | None = None
    ) -> Any:
        moved = _root_place(args, before) - _root_place(args, y)
        return _shifted(y, moved if is_reset is None else jnp.where(is_reset, moved, 0.0))

    def load(self, args: RigidScene, y: Any) -> Scalar:
        """Normal force on the foot that rolls [N]; an impact has an impulse instead."""
        return rolling(args, y).force.normal

    def load_under(self, args: RigidScene, y: Any, accelerations: tuple[Scalar, ...]) -> Scalar:
        def load(stance: Stance) -> Scalar:
            return ground_force(args, stance, accelerations).normal

        return of_stance(args, y, load)


ROLLING = Rolling()
"""It has no parts: one serves all."""


def _falls(value: Scalar, live: Scalar) -> Switch:
    return Switch(value, live, resets=True, first_only=True)


def _root_place(scene: RigidScene, state: Any) -> Scalar:
    """Where the root point is from the place of the standing foot at its body's angle 0 [m]."""
    return of_stance(scene, state, lambda stance: stance.root.x)


def _shifted(state: Any, distance: Scalar) -> Any:
    """A state farther down the slope [m]."""
    return type(state)(state[0] + distance, *state[1:])
