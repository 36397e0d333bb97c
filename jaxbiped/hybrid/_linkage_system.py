"""Linkages as hybrid systems: without guards."""

from collections.abc import Callable
from typing import ClassVar

import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_finite, check_type, check_unbatched
from jaxbiped._ending import Ending
from jaxbiped._types import Scalar, in_64_bits, is_traced
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.constraints._constraint_methods import (
    AbstractProjectingMethod,
    check_independent,
    correct_step,
    nearest_consistent,
)
from jaxbiped.constraints._linkage import constraints_of
from jaxbiped.dynamics._constrained_motion import linkage_field
from jaxbiped.hybrid._endings import ending_events
from jaxbiped.hybrid._guards import Switch
from jaxbiped.hybrid._implicit_field import ImplicitField, with_unit_mass
from jaxbiped.hybrid._sections import AbstractSection, Section
from jaxbiped.hybrid._system import AbstractSystem
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.scene._linkage_scene import LinkageScene, LinkageState

_FAR = 0.5
"""Distance of a start from its joints, in units of the longest arm, beyond which it is refused."""


class Swinging(AbstractSystem):
    """A linkage in gravity."""

    refuses: ClassVar[tuple[str, ...]] = ("footsteps",)
    reached: ClassVar[Ending] = Ending.FINISHED
    vector_field: ClassVar[ImplicitField] = with_unit_mass(linkage_field)

    def start(self, args: LinkageScene, y: PyTree) -> tuple[LinkageState, Scalar]:
        """The nearest state on the joints, and how far the one that is given is off them [m]."""
        check_unbatched("scene", args, "one linkage")
        check_type("state", y, LinkageState)
        count = args.linkage.coordinates * len(args.linkage.bodies)
        for name, values in y._asdict().items():
            if len(values) != count:
                raise ArgumentError(
                    f"state.{name} has {len(values)} entries: this linkage has {count} coordinates."
                )
            for value in values:
                check_finite(f"state.{name}", value)
        y = in_64_bits(LinkageState(*map(tuple, y)))
        check_unbatched("state", y, "one start")
        check_independent(args.linkage, args.method, y.q)
        off = self.violation(args, y)
        _check_joints(args, y, off)
        return _nearest(args, y), off

    def check_section(self, args: LinkageScene, section: AbstractSection) -> None:
        if not isinstance(section, Section):
            raise ArgumentError(
                f"section = {section!r} is not allowed for a LinkageScene: give a Section."
            )

    def violation(self, args: LinkageScene, states: LinkageState) -> Scalar:
        return _distance(args, states)

    def switches(self, args: LinkageScene, y: LinkageState) -> tuple[Switch, ...]:
        return ()

    def failures(self, watch: tuple[str, ...]) -> dict[Ending, Callable[..., Scalar]]:
        return ending_events(watch)

    def reset_map(self, args: LinkageScene, y: LinkageState) -> LinkageState:
        return y

    def load(self, args: LinkageScene, y: LinkageState) -> None:
        return None

    def projects(self, args: LinkageScene) -> bool:
        return args.method.projects

    def project(self, args: LinkageScene, y: PyTree) -> LinkageState:
        assert isinstance(args.method, AbstractProjectingMethod)
        return LinkageState(*map(tuple, correct_step(args.linkage, args.method, *y)))


_SWINGING = Swinging()


@system_of.register
def _(scene: LinkageScene) -> AbstractSystem:
    return _SWINGING


def _check_joints(scene: LinkageScene, state: LinkageState, off: Scalar) -> None:
    """Refuses a start whose joints are far open; what is traced is not looked at."""
    if is_traced((scene, state)):
        return
    arm = scene.linkage.longest_arm
    if arm > 0.0 and float(off) > _FAR * arm:
        raise ArgumentError(
            f"state is {float(off):.3g} m off its joints: give a start on its constraints, or "
            f"nearer than {_FAR:g} times the longest arm from a centre of mass to a joint, "
            f"{arm:.3g} m."
        )


@cached_jit
def _nearest(scene: LinkageScene, state: LinkageState) -> LinkageState:
    """The nearest state on the joints."""
    return LinkageState(*map(tuple, nearest_consistent(scene.linkage, *state)))


@cached_jit
def _distance(scene: LinkageScene, states: LinkageState) -> Scalar:
    """Distances of states from the constraints [m], shaped as their leaves."""
    values = constraints_of(scene.linkage, *states).violation
    squares = [value * value for value in values]
    zero = jnp.zeros_like(jtu.tree_leaves(states)[0])
    return jnp.sqrt(sum(squares[1:], squares[0])) if squares else zero
