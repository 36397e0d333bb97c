"""Options that describe starts: one, fitted to the scene where nothing is said; those of a basin.

The starts of a basin lie on a grid, are samples, or those of a file.
"""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import jaxbiped as jb
from jaxbiped._checks import ArgumentError, check_choice, check_finite
from jaxbiped._files import read_csv
from jaxbiped.cli._named_numbers import (
    LEG_SCALARS,
    named_text,
    numbers_in,
    parse_axis,
    unit_of_scalar,
    units_of,
)
from jaxbiped.cli._options import Check, Count, Options, one_of
from jaxbiped.cli._scene_options import SceneOptions
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
_USUAL = ("theta_{swing}=-0.5:0.3:100", "omega_{swing}=-2:4:100")
"""Axes of a basin that nobody chose, and as many starts on each."""
_USUAL_RIGID = ("theta_{stance}=0:0.5:100", "omega_{stance}=-2.5:0:100")


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
            own[name] = numbers_in("state", name, value, unit_of_scalar(name))[0]
        return own

    def check_names(self, scene: SceneOptions) -> None:
        """Raises `ArgumentError` for scalars and a leg that the seed's walker lacks."""
        if scene.walker != SEED_WALKER:
            return
        for name in self.given:
            if not name.startswith("bristle"):
                check_choice("a scalar of the state", name, _SCALARS)
        if self.standing is not None:
            check_choice("standing", self.standing.partition(".")[0], ("1", "2"))

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


_SCALARS = tuple(name for name in vars(StartOptions()) if name not in ("state", "standing"))
"""Scalars of the state of the seed's walker."""


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


_IS_AXIS = Check(lambda _, text: parse_axis(text))
Axis = Annotated[str | None, _IS_AXIS]


class StartsOptions(Options, of=("starts.sample", "starts.grid")):
    """The starts; coordinates that are not named have the value of the gait on its section."""

    x: Axis = None
    """Horizontal axis, as name=first:last:count: theta_stance, theta_swing, omega_stance,
    omega_swing, hip_z, hip_vx, hip_vz, or a parameter of the scene."""
    y: Axis = None
    """Vertical axis, in the same form."""
    more: Annotated[tuple[str, ...], _IS_AXIS._replace(each=True)] = ()
    """Further axes, in the same form."""
    samples: Count | None = None
    """Number of random starts within the ranges of the axes, instead of a grid."""
    sampling: Annotated[str, one_of("starts.SAMPLINGS")] = "sobol"
    """How random starts are drawn: uniform, latin-hypercube, sobol or halton."""
    seed: int
    """Random seed for drawing the starts."""
    place: bool = False
    """Place the stance leg on the ground, which determines the height and the velocity of the root
    point. Always on if an axis is an angle or rate of a body by its name in the state."""
    starts: Path | None = None
    """Label the starts of this file instead: CSV with the names of the state as its header, such as
    hip_x,hip_z,theta_1,theta_2,hip_vx,hip_vz,omega_1,omega_2, in the slope's frame."""

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes that were named, the horizontal one last."""
        return tuple(text for text in (*self.more, self.y, self.x) if text is not None)

    def check(self) -> None:
        if self.starts is not None and (self.axes or self.samples is not None):
            raise ArgumentError(
                f"starts = {str(self.starts)!r} is not allowed with x, y, more or "
                "samples: give one or the other."
            )
        super().check()
        if self.starts is not None:
            read_csv("starts", self.starts)

    def check_names(self, scene: SceneOptions) -> None:
        """Raises `ArgumentError` for axes along which no starts of the seed's walker differ."""

        def unit(name: str) -> str | None:
            if name in (*_SCALARS, *LEG_SCALARS) or name.startswith("bristle"):
                return unit_of_scalar(name)
            return scene.check_parameter("coordinate", name, *LEG_SCALARS, *_SCALARS)

        for text in self.axes if scene.walker == SEED_WALKER else ():
            parse_axis(text, unit)

    def chosen(self, scene: "jb.Scene | jb.RigidScene") -> "jb.starts.AbstractStarts":
        """The starts; raises `ArgumentError`."""
        import numpy as np

        if self.starts is not None:
            return jb.starts.GivenStarts(read_starts(self.starts, scene))
        axes = self._ranges(scene)
        if self.samples is None:
            values = {name: np.linspace(*axis) for name, axis in axes.items()}
            return jb.starts.grid(scene, values, place=self.place or None)
        return jb.starts.sample(
            scene,
            {name: (low, high) for name, (low, high, _) in axes.items()},
            self.samples,
            method=self.sampling,
            seed=self.seed,
            place=self.place or None,
        )

    def _ranges(self, scene: "jb.Scene | jb.RigidScene") -> dict[str, tuple[float, float, int]]:
        """First, last and count of each axis, the horizontal one last."""
        from jaxbiped.sweep.starts._coordinates import check_coordinates, coordinate_quantities

        axes: dict[str, tuple[float, float, int]] = {}
        units = units_of(coordinate_quantities(scene))
        for text in self.axes or _usual_axes(scene):
            name, axis = parse_axis(text, lambda name: units.get(name, ""))
            check_coordinates(scene, [name])
            if name in axes:
                raise ArgumentError(f"{name} is named by two axes: each needs its own.")
            axes[name] = axis
        return axes


def _usual_axes(scene: "jb.Scene | jb.RigidScene") -> tuple[str, ...]:
    """Of what swings and what stands where a cycle begins: one of the first pair each."""
    structure, roles = scene.mechanism.structure, {"swing": "swing", "stance": "stance"}
    if "theta_swing" not in jb.starts.coordinate_names(scene):
        roles = {role: structure.bodies[j] for role, j in zip(roles, structure.roles, strict=True)}
    y, x = (axis.format(**roles) for axis in (_USUAL if scene.compliant else _USUAL_RIGID))
    return x, y


def read_starts(path: Path, scene: "jb.Scene | jb.RigidScene") -> object:
    """Starts from a CSV file, leaves of shape (n,); a rigid walker keeps its part of them."""
    import numpy as np

    from jaxbiped._types import as_float
    from jaxbiped.scene._state_types import state_type_of

    structure = scene.mechanism.structure
    named, names = f"starts = {str(path)!r}", [*structure.coordinates, *structure.rates]
    (_, header), *rows = read_csv("starts", path)
    if header != names:
        refused = f"{named} has the header {','.join(header)!r}"
        raise ArgumentError(f"{refused}: it must be {','.join(names)}.")
    numbers = []
    for line, row in rows:
        try:
            numbers.append([float(cell) for cell in row])
        except ValueError:
            raise ArgumentError(
                f"{named}, line {line}: {','.join(row)!r} is not all numbers."
            ) from None
    whole: Any = state_type_of(names)(*map(as_float, np.array(numbers).T))
    return whole if scene.compliant else jb.dynamics.rigid_state(whole)
