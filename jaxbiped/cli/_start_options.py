"""Options that describe a start: what was said, and for the rest a start fitted to the scene."""

import math
from typing import TYPE_CHECKING, Annotated, Any

import jaxbiped as jb
from jaxbiped._checks import ArgumentError, check_choice, check_finite
from jaxbiped.cli._options import Check, Options
from jaxbiped.cli._scene_options import named_text, numbers_in
from jaxbiped.cli._walkers import SEED as SEED_WALKER
from jaxbiped.cli._walkers import usual_start

if TYPE_CHECKING:
    from jaxbiped._types import Scalar
    from jaxbiped.cli._scene_options import AnyScene

_DEEPEST = 0.1
"""The deepest that a foot begins in a soft ground, in units of l."""
_STEP = 1.01
"""Factor of the depth over which a law's exponent is read."""
_ROUNDS = 8


class StartOptions(Options):
    """Start in the slope's frame. If omitted: the seed's start, fitted to the scene."""

    hip_x: float | None = None
    """Position of the hip along the slope [m]; the seed's is 0."""
    hip_z: float | None = None
    """Height of the hip above the slope [m]; the seed's is 0.395, fitted to legs and ground."""
    theta_1: float | None = None
    """Angle of leg 1 from the slope's normal, foot ahead positive [rad]; the seed's is -0.2479."""
    theta_2: float | None = None
    """Angle of leg 2 [rad]; the seed's is 0.1655."""
    hip_vx: float | None = None
    """Hip velocity along the slope [m/s]; the seed's is 0.49797, fitted to the legs."""
    hip_vz: float | None = None
    """Hip velocity away from the slope [m/s]; the seed's is 0.05853, fitted to the legs."""
    omega_1: float | None = None
    """Rate of leg 1 [rad/s]; the seed's is -0.0052."""
    omega_2: float | None = None
    """Rate of leg 2 [rad/s]; the seed's is -1.2565."""
    state: Annotated[tuple[str, ...], Check(named_text, each=True)] = ()
    """Scalars of the state of any walker, as name=value: theta_BODY, omega_BODY, ROOT_z. Scalars
    that are not named are those of the walker's default start."""
    standing: str | None = None
    """Leg, body or foot BODY.FOOT that stands and rolls at a start given by --state."""

    @property
    def given(self) -> dict[str, float]:
        """The numbers that were said, by the names of the state's scalars."""
        own = {name: x for name, x in vars(self).items() if isinstance(x, float)}
        for text in self.state:
            name, value = named_text("state", text)
            if name in own:
                raise ArgumentError(f"state = {text!r} is not allowed: {name} is given twice.")
            own[name] = numbers_in("state", name, value, [value])[0]
        return own

    def check(self) -> None:
        """Raises `ArgumentError` for a number that is not finite."""
        super().check()
        for name, value in self.given.items():
            check_finite(f"state.{name}", value)
        if self.standing is not None and not self.state:
            raise ArgumentError(
                f"standing = {self.standing!r} is not allowed without state: it places a start "
                "that is given by --state."
            )

    def guess(self, scene: "AnyScene", walker: str) -> Any:
        """The start if any of it was said; else None, which leaves it to a search."""
        return self.start(scene, walker) if self.given else None

    def start(self, scene: "AnyScene", walker: str = SEED_WALKER) -> Any:
        """The start of a walker, of the kind that the scene needs; raises `ArgumentError`.

        What was not said is the walker's usual start, or else the seed's, fitted to the scene; what
        a rigid walker's state does not have is left out.
        """
        from jaxbiped._types import as_float

        self.check()
        structure, given = scene.mechanism.structure, self.given
        usual: dict[str, Any] = dict(usual_start(walker))
        bristles = structure.bristles if scene.has_bristles else ()
        for name in given:
            known = (*structure.coordinates, *structure.rates, *bristles)
            check_choice("a scalar of the state", name, known)
        if self.standing is None and not usual and isinstance(scene.walker, jb.Walker):
            start = default_start(scene)
            own = {name: as_float(x) for name, x in given.items() if name in start._fields}
            return start._replace(**own)
        if not usual:
            from jaxbiped.gait._search_starts import default_guess

            named = default_guess(scene)._asdict().items()
            usual = {name: float(x) for name, x in named if name.startswith(("theta_", "omega_"))}
        whole: dict[str, Any] = {"standing": structure.legs[-1], **usual, **given}
        if self.standing is not None:
            whole["standing"] = self.standing
        return scene.minimal.state(**whole)


def default_start(scene: Any) -> Any:
    """The seed's start, fitted to the scene's legs and as loaded on its ground as on its own.

    For the seed's own scene it is the seed's start to the last bit.
    """
    seed, own = jb.seed_state(), jb.seed_scene()
    if scene.compliant and _fitted_to(scene) == _fitted_to(own):
        return seed
    from jaxbiped.caching._cached_jit import cached_jit
    from jaxbiped.gait._search_starts import default_guess

    start: Any = default_guess(scene)
    if not scene.compliant:
        return start
    depth = jb.dynamics.standing_height(own, seed.theta_2) - seed.hip_z
    load = (scene.walker.total_mass * scene.ground.g) / (own.walker.total_mass * own.ground.g)
    fitted = float(cached_jit(_depth)(scene.normal, own.normal, depth, load))
    if not math.isfinite(fitted):
        return start
    fitted = min(fitted, _DEEPEST * float(scene.walker.l))
    return start._replace(hip_z=jb.dynamics.standing_height(scene, seed.theta_2, fitted))


def _fitted_to(scene: Any) -> tuple[Any, list[float]]:
    """What a start is fitted to, to be compared."""
    import jax.tree_util as jtu

    leaves, structure = jtu.tree_flatten((scene.walker, scene.normal, scene.ground.g))
    return structure, [float(leaf) for leaf in leaves]


def _depth(law: Any, own: Any, depth: "Scalar", load: "Scalar") -> "Scalar":
    """Where a law's elastic force is `load` times another one's at `depth` [m].

    Elastic forces grow like powers of the depth, or nearly so.
    """
    import jax.numpy as jnp

    target, found = load * own.elastic_force(depth), depth
    for _ in range(_ROUNDS):
        force = law.elastic_force(found)
        exponent = jnp.log(law.elastic_force(_STEP * found) / force) / jnp.log(_STEP)
        found = found * (target / force) ** (1.0 / exponent)
    return found
