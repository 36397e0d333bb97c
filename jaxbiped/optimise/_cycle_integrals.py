"""Cycle integrals as cyclic coordinates: slip, losses and depth of the swing foot along an orbit.

A coordinate whose rate is the integrand, and on which no rate depends, gains the integral over a
cycle. The return map then has its value, its derivatives and their errors from one solve.
"""

from collections import namedtuple
from typing import Any, ClassVar

import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time
from jaxbiped.dynamics._bristle_state import BristleState
from jaxbiped.dynamics._energy import powers
from jaxbiped.dynamics._feet import feet, touches
from jaxbiped.dynamics._impact import impact
from jaxbiped.dynamics._rigid_state import RigidState, WalkerState, whole_state
from jaxbiped.dynamics._rolling import inertia_of, support_of
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.dynamics._state import State
from jaxbiped.dynamics._switches import Switch
from jaxbiped.scene._rigid_scene import RigidScene
from jaxbiped.scene._scene import Scene
from jaxbiped.variational._hybrid_system import AbstractSystem, Rolling, Walking

COMPLIANT = ("slip_distance", "friction_loss", "impact_loss")
"""Integrals of a walker with laws of contact."""
RIGID = ("impact_loss",)
"""Those of the rigid walker."""


def _with_integrals(kind: Any, integrals: tuple[str, ...]) -> Any:
    """The kind of state with integrals just behind hip_x: before all that must return."""
    place, *recurring = kind._fields
    return namedtuple("_Integrated", (place, *integrals, *recurring))


_KINDS: dict[type, Any] = {
    State: _with_integrals(State, COMPLIANT),
    BristleState: _with_integrals(BristleState, COMPLIANT),
    RigidState: _with_integrals(RigidState, RIGID),
}
_OWN = {kind: own for own, kind in _KINDS.items()}


def with_integrals(state: WalkerState) -> PyTree:
    """A walker's state with integrals that begin at zero."""
    zero = jnp.zeros_like(state.hip_x)
    kind = _KINDS[type(state)]
    return kind(**{**dict.fromkeys(kind._fields, zero), **state._asdict()})


def _motion(y: PyTree) -> Any:
    """The walker's own state."""
    own: Any = _OWN[type(y)]
    return own(*(getattr(y, name) for name in own._fields))


def _joined(like: PyTree, motion: PyTree, integrals: dict[str, Scalar]) -> PyTree:
    return type(like)(**{**motion._asdict(), **integrals})


def _depth(penetration: Scalar, admitted: Scalar, deepest: Scalar) -> Scalar:
    return jnp.where(admitted, -deepest, penetration)


class WalkingIntegrals(AbstractSystem):
    """`Walking` with its integrals; its load is the depth of a foot that swings [m]."""

    cyclic_coordinates: ClassVar[tuple[int, ...]] = tuple(range(1 + len(COMPLIANT)))
    reset_is_symmetry: ClassVar[bool] = True

    def vector_field(self, t: Time, y: PyTree, args: Scene) -> PyTree:
        state = _motion(y)
        power = powers(args, state)
        slip = jnp.zeros_like(state.hip_x)
        for foot in feet(args, state):
            slip = slip + jnp.where(touches(foot), jnp.abs(foot.slip_speed), 0.0)
        rates = {
            "slip_distance": slip,
            "friction_loss": power.friction,
            "impact_loss": power.indentation,
        }
        return _joined(y, Walking().vector_field(t, state, args), rates)

    def switches(self, args: Scene, y: PyTree) -> tuple[Switch, ...]:
        """The walker's, touchdown as a jump of the rate of slip, and slip's change of sign."""
        state = _motion(y)
        own = Walking().switches(args, state)
        for foot in feet(args, state):
            admitted = True if foot.admitted is None else foot.admitted
            own += (Switch(foot.penetration, admitted, force_jumps=True),)
            own += (Switch(foot.slip_speed, touches(foot)),)
        return own

    def ending(self, args: Scene, y: PyTree) -> Scalar:
        return Walking().ending(args, _motion(y))

    def reset_map(self, args: Scene, y: PyTree) -> PyTree:
        gained = {name: getattr(y, name) for name in COMPLIANT}
        return _joined(y, Walking().reset_map(args, _motion(y)), gained)

    def load(self, args: Scene, y: PyTree) -> Scalar:
        """How deep a foot is underground that the clearance rule lets pass [m]."""
        found = -args.walker.l
        for foot in feet(args, _motion(y)):
            if foot.admitted is not None and foot.admitted is not False:
                depth = _depth(foot.penetration, jnp.asarray(foot.admitted), args.walker.l)
                found = jnp.maximum(found, depth)
        return found


class RollingIntegrals(AbstractSystem):
    """`Rolling` with the energy that impacts take; its load is the swing foot's depth [m]."""

    cyclic_coordinates: ClassVar[tuple[int, ...]] = tuple(range(1 + len(RIGID)))

    def vector_field(self, t: Time, y: PyTree, args: RigidScene) -> PyTree:
        state = _motion(y)
        rates = {"impact_loss": jnp.zeros_like(state.hip_x)}
        return _joined(y, Rolling().vector_field(t, state, args), rates)

    def switches(self, args: RigidScene, y: PyTree) -> tuple[Switch, ...]:
        return ()

    def ending(self, args: RigidScene, y: PyTree) -> Scalar:
        return Rolling().ending(args, _motion(y))

    def reset_map(self, args: RigidScene, y: PyTree) -> PyTree:
        state = _motion(y)
        after = impact(args, state).state
        lost = _kinetic(args, state) - _kinetic(args, after)
        return _joined(y, after, {"impact_loss": y.impact_loss + lost})

    def load(self, args: RigidScene, y: PyTree) -> Scalar:
        """How deep the swing foot is underground [m]."""
        return args.walker.hip_to_foot * (jnp.cos(y.theta_1) - jnp.cos(y.theta_2))


def _kinetic(scene: RigidScene, state: RigidState) -> Scalar:
    """Kinetic energy of the walker that rolls on leg 2 [J]."""
    whole = whole_state(scene, state)
    sine, cosine = jnp.sin(whole.theta_1), jnp.cos(whole.theta_1)
    inertia = inertia_of(scene.walker, support_of(scene.walker, state.theta_2), sine, cosine)
    own = inertia.stance * state.omega_2**2 + inertia.swing * state.omega_1**2
    return 0.5 * own + inertia.coupling * state.omega_1 * state.omega_2


class MotionSection(AbstractSection):
    """The walker's own section, of a state with integrals.

    Attributes:
        section: of the walker.
    """

    section: AbstractSection

    def value(self, args: PyTree, y: PyTree) -> Scalar:
        return self.section.value(args, _motion(y))

    def counts(self, args: PyTree, y: PyTree) -> Scalar:
        return self.section.counts(args, _motion(y))


def integrals_of(scene: Scene | RigidScene) -> AbstractSystem:
    """The walker with its integrals."""
    return WalkingIntegrals() if scene.compliant else RollingIntegrals()
