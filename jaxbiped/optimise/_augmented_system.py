"""Augmented systems: a walker's state with further coordinates, which it does not know itself.

Integrals over a cycle, a clock, a disturbance. An integral (slip, losses, motors' work) is a
coordinate whose rate is the integrand, and on which no rate depends: in a cycle it gains that. The
return map then has its value, its derivatives and their errors from one solve.
"""

from collections import namedtuple
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
from equinox import AbstractVar
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time, by_numpy
from jaxbiped.dynamics._contacts import feet
from jaxbiped.dynamics._energy import is_driven, kinetic_energy, powers
from jaxbiped.dynamics._footfalls import touches
from jaxbiped.dynamics._impact import impact, push_off_work
from jaxbiped.dynamics._surfaces import AbstractSection, Switch, clearance
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.scene._state_types import WalkerState
from jaxbiped.variational._hybrid_system import AbstractSystem, Rolling, Walking

_KINDS: dict[tuple[type, tuple[str, ...]], Any] = {}
"""Of each walker's state the augmented ones: always the same types, or all would compile again."""


def _augmented_type(walker: Any, names: tuple[str, ...]) -> Any:
    if (walker, names) not in _KINDS:
        place, *recurring = walker._fields
        fields: Any = namedtuple("_Augmented", (place, *names, *recurring))  # type: ignore[misc]
        # By this other processes know it, see `jaxbiped.caching._fingerprint`.
        made_by = (_augmented_type, walker, names)
        own: dict[str, Any] = {"__slots__": (), "__made_by__": made_by, "__reduce__": _taken_apart}
        # Whatever they are, their errors count in SI units.
        own["own_units"] = getattr(walker, "own_units", {}) | dict.fromkeys(names, "")
        _KINDS.setdefault((walker, names), type("_Augmented", (fields,), own))
    return _KINDS[walker, names]


def _taken_apart(y: Any) -> tuple[Any, ...]:
    """An augmented state as `pickle` keeps it."""
    _, _, names = type(y).__made_by__
    return _put_together, (motion_of(y), {name: getattr(y, name) for name in names})


def _put_together(motion: Any, coordinates: dict[str, Any]) -> Any:
    return _augmented_type(type(motion), tuple(coordinates))(**coordinates, **motion._asdict())


def augment(state: WalkerState, names: tuple[str, ...]) -> PyTree:
    """A walker's state with coordinates of these names, which begin at zero."""
    zero = by_numpy(lambda numpy, place: numpy.zeros_like(place), state[0])
    return _augmented_type(type(state), names)(**dict.fromkeys(names, zero), **state._asdict())


def motion_of(y: PyTree) -> Any:
    """The walker's own state."""
    _, walker, _ = type(y).__made_by__
    return walker(*(getattr(y, name) for name in walker._fields))


def join(like: PyTree, motion: PyTree, coordinates: dict[str, Scalar]) -> PyTree:
    """A walker's state or rates, and those of the further coordinates, as one."""
    return type(like)(**motion._asdict(), **coordinates)


class AbstractAugmentedSystem(AbstractSystem):
    """A walker with further coordinates.

    Attributes:
        walker: the walker without them, or with others.
        coordinates: their names, as they lie behind the root point's place.
        recurring: how many of them, the last ones, must return.
    """

    walker: AbstractVar[AbstractSystem]
    coordinates: AbstractVar[tuple[str, ...]]
    recurring: ClassVar[int] = 0

    @property
    def cyclic_coordinates(self) -> tuple[int, ...]:  # type: ignore[override]
        """The walker's, and those that need not return."""
        own = len(self.coordinates) - self.recurring
        return tuple(range(own + len(self.walker.cyclic_coordinates)))

    def begin(self, state: WalkerState) -> PyTree:
        """A walker's state with coordinates that begin at zero."""
        inner = (
            self.walker.begin(state) if isinstance(self.walker, AbstractAugmentedSystem) else state
        )
        return augment(inner, self.coordinates)

    def scene_of(self, args: PyTree, y: PyTree) -> PyTree:
        """The scene as the walker has it: as it is unless the coordinates change it."""
        return args

    def switches(self, args: PyTree, y: PyTree) -> tuple[Switch, ...]:
        return self.walker.switches(self.scene_of(args, y), motion_of(y))

    def reset_at_switch(self, args: PyTree, y: PyTree) -> PyTree:
        after = self.walker.reset_at_switch(self.scene_of(args, y), motion_of(y))
        return self.with_motion(y, after)

    def on_held(self, args: PyTree, y: PyTree) -> PyTree:
        return self.with_motion(y, self.walker.on_held(args, motion_of(y)))

    def ending(self, args: PyTree, y: PyTree) -> Scalar:
        return self.walker.ending(self.scene_of(args, y), motion_of(y))

    def arrival(self, section: AbstractSection, args: PyTree, y: PyTree) -> tuple[Scalar, Scalar]:
        if isinstance(section, MotionSection):
            return self.walker.arrival(section.section, self.scene_of(args, y), motion_of(y))
        return super().arrival(section, args, y)

    def load(self, args: PyTree, y: PyTree) -> Scalar | None:
        return None

    def with_motion(self, y: PyTree, motion: PyTree) -> PyTree:
        """A state of the walker with the coordinates of another."""
        return join(y, motion, {name: getattr(y, name) for name in self.coordinates})


class MotionSection(AbstractSection):
    """The walker's own section, of an augmented state.

    Attributes:
        section: of the walker.
    """

    section: AbstractSection

    def value(self, args: PyTree, y: PyTree) -> Scalar:
        return self.section.value(args, motion_of(y))

    def counts(self, args: PyTree, y: PyTree) -> Scalar:
        return self.section.counts(args, motion_of(y))


COMPLIANT = ("slip_distance", "friction_loss", "impact_loss")
"""Integrals of a walker with laws of contact."""
RIGID = ("impact_loss",)
"""Those of the rigid walker."""
MOTOR_WORK = "motor_work"
"""What a driven walker of either kind has beside them."""


def _driving(motors: tuple[Scalar, ...], like: Scalar) -> Scalar:
    """Power of the motors that drive, added up [W]: none gains energy by braking."""
    power = jnp.zeros_like(like)
    for motor in motors:
        power = power + jnp.maximum(motor, 0.0)
    return power


class WalkingIntegrals(AbstractAugmentedSystem):
    """`Walking` with its integrals; its load is the depth of a foot that swings [m].

    Attributes:
        walker: that system.
        coordinates: names of the integrals.
    """

    walker: Walking
    coordinates: tuple[str, ...] = eqx.field(static=True)

    def vector_field(self, t: Time, y: PyTree, args: Scene) -> PyTree:
        state = motion_of(y)
        power = powers(args, state)
        slip = jnp.zeros_like(state[0])
        for foot in feet(args, state):
            slip = slip + jnp.where(touches(foot), jnp.abs(foot.slip_speed), 0.0)
        rates = {
            "slip_distance": slip,
            "friction_loss": power.friction,
            "impact_loss": power.indentation,
        }
        if power.motors is not None:
            rates[MOTOR_WORK] = _driving(power.motors, slip)
        return join(y, self.walker.vector_field(t, state, args), rates)

    def switches(self, args: Scene, y: PyTree) -> tuple[Switch, ...]:
        """The walker's, touchdown as a jump of the rate of slip, and changes of sign.

        Those of slip, and of each motor's power.
        """
        state = motion_of(y)
        own = self.walker.switches(args, state)
        for foot in feet(args, state):
            admitted = True if foot.admitted is None else foot.admitted
            own += (Switch(foot.penetration, admitted, force_jumps=True),)
            own += (Switch(foot.slip_speed, touches(foot)),)
        motors = powers(args, state).motors or ()
        return own + tuple(Switch(power, True) for power in motors)

    def reset_map(self, args: Scene, y: PyTree) -> PyTree:
        return self.with_motion(y, self.walker.reset_map(args, motion_of(y)))

    def load(self, args: Scene, y: PyTree) -> Scalar:
        """How deep a foot is underground that the clearance rule lets pass [m]."""
        none = -args.mechanism.height
        found = none
        for foot in feet(args, motion_of(y)):
            if foot.admitted is not None and foot.admitted is not False:
                admitted = jnp.asarray(foot.admitted)
                found = jnp.maximum(found, jnp.where(admitted, none, foot.penetration))
        return found


class RollingIntegrals(AbstractAugmentedSystem):
    """`Rolling` with the energy that impacts and joints take; its load is the swing foot's depth.

    Impacts are also those of stops and soles. The work of motors includes that of the push-off.

    Attributes:
        walker: that system.
        coordinates: names of the integrals.
    """

    walker: Rolling
    coordinates: tuple[str, ...] = eqx.field(static=True)

    def vector_field(self, t: Time, y: PyTree, args: RigidScene) -> PyTree:
        state = motion_of(y)
        power = powers(args, state)
        rates = {"impact_loss": power.indentation}
        if power.motors is not None:
            rates[MOTOR_WORK] = _driving(power.motors, state[0])
        return join(y, self.walker.vector_field(t, state, args), rates)

    def switches(self, args: RigidScene, y: PyTree) -> tuple[Switch, ...]:
        """The walker's, and each motor's change of sign."""
        state = motion_of(y)
        motors = powers(args, state).motors or ()
        return self.walker.switches(args, state) + tuple(Switch(power, True) for power in motors)

    def reset_at_switch(self, args: RigidScene, y: PyTree) -> PyTree:
        state = motion_of(y)
        after = self.walker.reset_at_switch(args, state)
        lost = kinetic_energy(args, state) - kinetic_energy(args, after)
        return self.with_motion(y._replace(impact_loss=y.impact_loss + lost), after)

    def reset_map(self, args: RigidScene, y: PyTree) -> PyTree:
        state = motion_of(y)
        after = impact(args, state).state
        push = push_off_work(args, state)
        lost = kinetic_energy(args, state) + push - kinetic_energy(args, after)
        gained = {"impact_loss": y.impact_loss + lost}
        if MOTOR_WORK in self.coordinates:
            gained[MOTOR_WORK] = y.motor_work + jnp.maximum(push, 0.0)
        return join(y, after, gained)

    def load(self, args: RigidScene, y: PyTree) -> Scalar:
        """How deep the swing foot is underground [m]."""
        return -clearance(args, motion_of(y))


def integrals_of(scene: Scene | RigidScene) -> WalkingIntegrals | RollingIntegrals:
    driven = (MOTOR_WORK,) if is_driven(scene) else ()
    if scene.compliant:
        return WalkingIntegrals(Walking(), (*COMPLIANT, *driven))
    return RollingIntegrals(Rolling(), (*RIGID, *driven))
