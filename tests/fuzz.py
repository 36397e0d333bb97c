"""Features of walkers and of doors, drawn in pairs and triples: an outcome, or one sentence.

    python -m tests.fuzz --seed 1 --count 50 --doors field walk gait

A draw is a number: the same one names the same features for ever. Of what fails, the features that
it needs are told.
"""

import argparse
import collections
import itertools
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import jaxbiped as jb
from tests.fuzz_doors import DOORS, WrongError

Features = dict[str, Any]

_METHODS = tuple(jb.constraints.CONSTRAINT_METHODS)
_OF_LAWS = ("normal", "friction", "clearance", "coordinates")
FEATURES: dict[str, tuple[Any, ...]] = {
    "contact": ("rigid", "compliant"),
    "legs": (2, 1, 3, "wheel"),
    "knees": ("none", "free", "stop", "both stops", "locks", "latch", "two stops", "welded"),
    "foot": (
        "round", "point", "zero radius", "arc", "heel and toe", "heel and toe on an ankle",
        "level with normal", "level with vertical", "level at an angle", "level sprung",
        "three feet", "twice the same", "one in the other", "unreached", "as long as the leg",
        "of no mass",
    ),
    "root": ("hip", "foot", "torso"),
    "torso": ("none", "spring", "damper", "free", "bisecting", "upright", "stop", "balanced"),
    "masses": (
        "usual", "hip only", "no inertia", "no mass in a leg", "points at the ends", "tiny", "huge",
        "no root mass", "centre at the hinge",
    ),
    "mirror": (True, False, "unlike"),
    "joint": (
        "none", "spring", "zero spring", "damper", "gear", "gear and spring", "latch of no torque",
        "stop between", "equal stops", "twice the same", "locked legs", "spring of two names",
        "stop at rest",
    ),
    "motor": (
        "none", "by role", "by side", "share of 0", "PD", "phase by side",
        "plain function", "NaN",
    ),
    "actuation": (
        "none", "HipSpring", "HipTorque", "HipPulse", "HipSpline", "PushOff", "FootPreload", "both",
        "zeros",
    ),
    "slope": (0.02, 0.0, -0.02, 0.5, 1.5),
    "g": (9.8, 0.0, 1e-6, 1e3),
    "normal": ("seed", *sorted(jb.laws.NORMAL_LAWS)),
    "friction": ("seed", *sorted(jb.laws.FRICTION_LAWS)),
    "clearance": ("none", "stance rotation", "one foot", "other foot"),
    "coordinates": ("minimal", *itertools.product(_METHODS, jb.constraints.ORIENTATIONS)),
    "start": (
        "usual", "at rest", "fast", "turned", "high", "float32", "integers", "array", "falling",
        "at limit", "backwards",
    ),
    "precision": ("balanced", "draft", "tight", 1e-4),
    "save": ("usual", "end", "steps", "strikes", "times", "midstance", "no time"),
    "ends": ("steps", "duration", "both", "no time", "many"),
    "solver": ("usual", "rodas3p", "rodas5p", "euler"),
    "within": ("plain", "jit", "vmap", "jacfwd", "grad", "bad lane"),
}  # fmt: skip
"""What a walker and a walk may be like; the first of each is plain."""


_REFUSED_ON_RIGID = {name: FEATURES[name] for name in _OF_LAWS} | {
    "legs": (1, 3),
    "foot": ("three feet",),
    "save": ("steps", "times", "midstance", "no time"),
    "solver": FEATURES["solver"],
    "actuation": ("FootPreload",),
}
"""What rigid feet refuse by itself."""


_ONE_SIDED = {"by side", "phase by side", "PD", "stop at rest", "foot"}
"""What no mirror has."""


SINGLES = -1
"""The seed with which each feature comes by itself."""


class Draw(NamedTuple):
    """What is not plain, by name."""

    features: Features

    def __str__(self) -> str:
        return ", ".join(f"{name}={value}" for name, value in self.features.items()) or "plain"


_OF_DOORS = ("precision", "save", "ends", "solver", "within")
"""What a field does not have."""


def draw(seed: int, number: int, doors: tuple[str, ...], only: Features | None = None) -> Draw:
    """Two to five features that are not plain, and the kind of feet."""
    rng, only = np.random.default_rng((seed + 1, number)), only or {}
    contact = only.get("contact", str(rng.choice(FEATURES["contact"])))
    refused = _REFUSED_ON_RIGID if contact == "rigid" else {}
    silent = _OF_DOORS if doors == ("field",) else ()
    able = {
        name: [value for value in values[1:] if value not in refused.get(name, ())]
        for name, values in FEATURES.items()
        if name not in {"contact", *silent, *only}
    }
    names = [name for name, values in able.items() if values]
    chosen = rng.choice(names, size=rng.integers(2, 6), replace=False).tolist()
    features = {name: able[name][rng.integers(len(able[name]))] for name in chosen}
    return Draw({"contact": contact} | features | only)


def single(number: int) -> Draw | None:
    """Each feature by itself, on both kinds of feet; None behind the last."""
    alone = [
        {"contact": contact, name: value}
        for name, values in FEATURES.items()
        for value in values[1:]
        for contact in FEATURES["contact"]
        if not (contact == "rigid" and value in _REFUSED_ON_RIGID.get(name, ()))
    ]
    return Draw(alone[number]) if number < len(alone) else None


def _wanted(features: Features, name: str) -> Any:
    return features.get(name, FEATURES[name][0])


# -- what walks -------------------------------------------------------------------------------


class _Plan:
    """Bodies, feet and joint parts of a walker, gathered leg by leg."""

    def __init__(self, features: Features) -> None:
        self.bodies: list[Any] = []
        self.feet: list[Any] = []
        self.joints: list[Any] = []
        self.pairs: list[tuple[str, str]] = []
        self.wants = lambda name: _wanted(features, name)
        self.law = jb.laws.HuntCrossley(K=50.0, hysteresis=0.3, n=1.0)

    def mass(self, usual: float, inertia: float) -> dict[str, float]:
        """Mass and inertia of a body of a leg."""
        return {
            "hip only": dict(mass=0.0, inertia=0.0),
            "no inertia": dict(mass=usual, inertia=0.0),
            "no mass in a leg": dict(mass=0.0, inertia=inertia),
            "tiny": dict(mass=1e-9 * usual, inertia=1e-9 * inertia),
            "huge": dict(mass=1e6 * usual, inertia=1e6 * inertia),
        }.get(self.wants("masses"), dict(mass=usual, inertia=inertia))

    def leg(self, i: int) -> None:
        """A leg from the root point to its feet."""
        unlike = 1.2 if self.wants("mirror") == "unlike" and i == 1 else 1.0
        centre = {"points at the ends": 0.4, "centre at the hinge": 0.0}.get(
            self.wants("masses"), 0.1
        )
        knees, parent, left = self.wants("knees"), f"leg_{i}", 0.4
        root = self.wants("root")
        hung = {}
        if root == "torso":
            hung = dict(parent="trunk", at=0.2)
        elif root == "foot" and i > 1:
            hung = dict(parent="leg_1", at=-0.4)
        if root == "foot" and i == 1:
            self.bodies.append(jb.Body("leg_1", **self.mass(1.0, 0.0096), centre=-0.3))
            self.feet.append(jb.Foot("leg_1", centre=0.0, radius=0.08))
            return
        self.bodies.append(
            jb.Body(parent, **self.mass(unlike, 0.0096 * unlike), centre=centre, **hung)
        )
        if knees != "none":
            shank, left = f"shank_{i}", 0.2
            self.bodies.append(
                jb.Body(shank, **self.mass(0.3, 0.002), centre=0.08, parent=parent, at=0.2)
            )
            self.joints += self.knee(shank, knees)
            parent = shank
        self.foot(i, parent, left)

    def knee(self, shank: str, kind: str) -> list[Any]:
        """What holds a knee."""
        stop = lambda **given: jb.Stop(shank, law=self.law, **given)
        return {
            "free": lambda: [],
            "stop": lambda: [stop(upper=0.0)],
            "both stops": lambda: [stop(upper=0.0, lower=-0.5)],
            "locks": lambda: [stop(upper=0.0, holds="until heel strike")],
            "latch": lambda: [jb.Latch(shank, width=0.1, torque=0.5)],
            "two stops": lambda: [stop(upper=0.0, name="one"), stop(upper=0.0, name="two")],
            "welded": lambda: [jb.Coupling(shank)],
        }[kind]()

    def foot(self, i: int, body: str, left: float) -> None:
        """The feet of a leg, on what is left of it below its last hinge."""
        kind = self.wants("foot")
        foot = lambda *args, **given: self.feet.append(jb.Foot(*args, **given))
        if kind == "round":
            foot(body, centre=left - 0.08, radius=0.08)
        elif kind == "point":
            foot(body, centre=left)
        elif kind == "zero radius":
            foot(body, centre=left, radius=0.0)
        elif kind == "arc":
            foot(body, centre=(left - 0.3, 0.02), radius=0.3)
        elif kind == "as long as the leg":
            foot(body, centre=0.0, radius=left)
        elif kind == "unreached":
            foot(body, centre=left - 0.08, radius=0.08)
            foot(body, centre=0.05, name="never")
        elif kind in ("heel and toe", "three feet"):
            foot(body, centre=(left, -0.03), name="heel")
            foot(body, centre=(left, 0.05), name="toe")
            if kind == "three feet":
                foot(body, centre=left, name="sole")
        elif kind == "twice the same":
            foot(body, centre=left, name="one")
            foot(body, centre=left, name="two")
        elif kind == "one in the other":
            foot(body, centre=left - 0.08, radius=0.08, name="one")
            foot(body, centre=left - 0.05, radius=0.03, name="two")
        else:
            own, light = f"foot_{i}", dict(mass=0.05, inertia=2e-5)
            if kind == "of no mass":
                light = dict(mass=0.0, inertia=0.0)
            self.bodies.append(jb.Body(own, **light, centre=0.01, parent=body, at=left - 0.02))
            foot(own, centre=(0.02, -0.03), name="heel")
            foot(own, centre=(0.02, 0.05), name="toe")
            self.joints += {
                "level with normal": [jb.Coupling({own: 1, "normal": -1})],
                "level with vertical": [jb.Coupling({own: 1, "vertical": -1})],
                "level at an angle": [jb.Coupling({own: 1, "normal": -1}, rest=0.1)],
                "level sprung": [
                    jb.Coupling({own: 1, "normal": -1}),
                    jb.Stop({own: 1, "normal": -1}, upper=0.0, law=self.law),
                ],
            }.get(kind, [jb.Spring(own, stiffness=8.0, damping=0.05)])

    def trunk(self) -> None:
        """What stands on the hip."""
        kind, angle = self.wants("torso"), {"torso": 1, "vertical": -1}
        if kind == "none":
            return
        hangs = {} if self.wants("root") != "foot" else dict(parent="leg_1", at=-0.4)
        centre = 0.0 if kind == "balanced" else -0.1
        self.bodies.append(jb.Body("torso", mass=0.3, inertia=0.0015, centre=centre, **hangs))
        bisecting = {"torso": 1, "leg_1": -0.5, "leg_2": -0.5}
        self.joints += {
            "spring": [jb.Spring(angle, stiffness=16.0)],
            "damper": [jb.Spring(angle, damping=0.1)],
            "bisecting": [jb.Coupling(bisecting)],
            "upright": [jb.Coupling(angle)],
            "stop": [jb.Stop(angle, upper=0.2, lower=-0.2, law=self.law)],
            "balanced": [jb.Coupling(angle)],
        }.get(kind, [])

    def between(self) -> None:
        """What acts between the legs."""
        kind, legs = self.wants("joint"), {"leg_1": 1, "leg_2": -1}
        single = {"leg_2": 1, "vertical": -1}
        spring = jb.Spring(legs, stiffness=2.0)
        self.joints += {
            "none": lambda: [],
            "spring": lambda: [spring],
            "zero spring": lambda: [jb.Spring(legs, stiffness=0.0)],
            "damper": lambda: [jb.Spring(legs, damping=0.02)],
            "gear": lambda: [jb.Coupling({"leg_1": 1, "leg_2": 1, "normal": -2})],
            "gear and spring": lambda: [
                jb.Coupling({"leg_1": 1, "leg_2": 1, "normal": -2}),
                spring,
            ],
            "latch of no torque": lambda: [jb.Latch(legs, width=0.1, torque=0.0)],
            "stop between": lambda: [jb.Stop(legs, upper=0.6, lower=-0.6, law=self.law)],
            "equal stops": lambda: [jb.Stop(legs, upper=0.0, lower=0.0, law=self.law)],
            "twice the same": lambda: [spring, spring],
            "locked legs": lambda: [jb.Coupling(legs)],
            "spring of two names": lambda: [spring, jb.Spring(legs, stiffness=1.0, name="second")],
            "stop at rest": lambda: [jb.Stop(single, upper=2.0, lower=-0.25, law=self.law)],
        }[kind]()
        self.joints += self.motors(legs)

    def motors(self, legs: Any) -> list[Any]:
        """What drives it at a joint."""
        constant = jb.actuation.Constant(torque=0.05)
        phased = jb.actuation.Pulse(torque=0.1, at=0.0, width=0.1)
        wants = self.wants("motor")
        return {
            "none": lambda: [],
            "by role": lambda: [jb.Motor(legs, constant)],
            "by side": lambda: [jb.Motor({"leg_1": 1, "normal": -1}, constant, by="side")],
            "share of 0": lambda: [jb.Motor(legs, constant, share=0.0)],
            "PD": lambda: [jb.Motor("leg_1", jb.actuation.PD(kp=1.0, kd=0.1, target=0.2))],
            "phase by side": lambda: [jb.Motor({"leg_1": 1, "normal": -1}, phased, by="side")],
            "plain function": lambda: [jb.Motor(legs, lambda motion: 0.1 * jnp.sin(motion.angle))],
            "NaN": lambda: [jb.Motor(legs, lambda motion: jnp.nan * motion.angle)],
        }[wants]()


def _wheel() -> Any:
    turned = [
        jb.Foot("wheel", centre=(0.4 * np.cos(a), 0.4 * np.sin(a)), name=f"n{k}", leg=f"s{k}")
        for k, a in enumerate(2.0 * np.pi * np.arange(6) / 6)
    ]
    body = jb.Body("wheel", mass=1.0, inertia=0.05, centre=0.0)
    return jb.Mechanism(bodies=(body,), feet=turned, turn={"wheel": 6})


def walker_of(features: Features) -> Any:
    """The mechanism of a draw."""
    plan, legs = _Plan(features), _wanted(features, "legs")
    if legs == "wheel":
        return _wheel()
    if plan.wants("root") == "torso":
        plan.bodies.append(jb.Body("trunk", mass=1.0, inertia=0.01, centre=0.1))
    for i in range(1, legs + 1):
        plan.leg(i)
    plan.trunk()
    if legs > 1:
        plan.between()
    names = [body.name for body in plan.bodies]
    pairs = [(n, n[:-1] + "2") for n in names if n.endswith("_1") and n[:-1] + "2" in names]
    alike = "mirror" in features or not _ONE_SIDED & set(map(str, features.values()))
    mass = {"hip only": 1.0, "no root mass": None, "huge": 1e6}.get(plan.wants("masses"), 0.5)
    return jb.Mechanism(
        root={"hip": "hip", "foot": "sole", "torso": "top"}[plan.wants("root")],
        root_mass=mass,
        bodies=plan.bodies,
        feet=plan.feet,
        joints=plan.joints,
        mirror=pairs if plan.wants("mirror") is True and alike else (),
    )


def _actuators(kind: str) -> Any:
    law = jb.actuation
    return {
        "none": lambda: None,
        "HipSpring": lambda: law.HipSpring(k=1.0, b=0.1),
        "HipTorque": lambda: law.HipTorque(torque=0.05),
        "HipPulse": lambda: law.HipPulse(pulse=0.1),
        "HipSpline": lambda: law.HipSpline(torque=(0.0, 0.1, 0.0)),
        "PushOff": lambda: law.PushOff(impulse=0.05),
        "FootPreload": lambda: law.FootPreload(extension=0.01),
        "both": lambda: (law.HipSpring(k=1.0), law.HipSpring(k=2.0)),
        "zeros": lambda: (law.HipSpring(k=0.0), law.HipTorque(torque=0.0)),
    }[kind]()


def scene_of(features: Features) -> Any:
    """The scene of a draw."""
    wants = lambda name: _wanted(features, name)
    walker, seed = walker_of(features), jb.seed_scene()
    ground = jb.Ground(slope=wants("slope"), g=wants("g"))
    actuation = _actuators(wants("actuation"))
    if wants("contact") == "rigid":
        return jb.RigidScene(walker, ground, actuation)
    normal, friction = seed.normal, seed.friction
    if wants("normal") != "seed":
        normal = jb.laws.normal_law_like(wants("normal"))
    if wants("friction") != "seed":
        friction = jb.laws.friction_law_like(wants("friction"))
    clearance = {
        "none": None,
        "stance rotation": jb.laws.StanceRotation(),
        "one foot": jb.laws.OneFoot("leg_2"),
        "other foot": jb.laws.OneFoot("leg_1"),
    }[wants("clearance")]
    scene = jb.Scene(walker, ground, normal, friction, clearance, actuation)
    if wants("coordinates") == "minimal":
        return scene
    method, orientation = wants("coordinates")
    return jb.RedundantScene(scene, method, orientation)


def start_of(features: Features, scene: Any) -> Any:
    """Its start."""
    kind, of = _wanted(features, "start"), scene.minimal
    names = set(of.state_names)
    usual = {
        "theta_leg_1": -0.25, "theta_leg_2": 0.25, "theta_shank_1": -0.25, "theta_shank_2": 0.25,
        "omega_leg_1": -0.3, "omega_leg_2": -1.3, "omega_shank_1": -0.3, "omega_shank_2": -1.3,
        "theta_wheel": 0.2, "omega_wheel": -1.0, "theta_foot_1": -0.25, "theta_foot_2": 0.25,
    }  # fmt: skip
    values = {
        "usual": usual,
        "at rest": {},
        "fast": usual | {"omega_leg_2": -1e3},
        "turned": usual | {"theta_leg_1": 7.0, "omega_leg_1": 2.0},
        "falling": usual | {"theta_leg_2": 1.6, "theta_shank_2": 1.6},
        "at limit": usual | {"omega_shank_1": 0.0, "omega_shank_2": 0.0},
        "backwards": usual | {"omega_leg_2": 3.0},
        "integers": {name: 0 for name in usual} | {"omega_leg_2": -1},
        "array": {name: np.array([x, x]) for name, x in usual.items()},
    }.get(kind, usual)
    given = {name: value for name, value in values.items() if name in names}
    if scene.compliant and "hip_vx" in names:
        given["hip_vx"] = 0.5
    state = of.state(**given)
    if kind == "float32":
        state = jax.tree.map(jnp.float32, state)
    if kind == "high" and scene.compliant:
        state = state._replace(**{state._fields[1]: getattr(state, state._fields[1]) + 0.1})
    return state


# -- what comes of it -------------------------------------------------------------------------


class Failure(NamedTuple):
    """What is not allowed: where, and the kind of it."""

    door: str
    kind: str
    words: str


def _told(door: str, error: BaseException) -> Failure | None:
    """None for one sentence."""
    text = str(error)
    if isinstance(error, jb.ArgumentError) and "\n" not in text.strip() and text.strip():
        return None
    if isinstance(error, WrongError):
        return Failure(door, error.args[0], text)
    frames = [f for f in traceback.extract_tb(error.__traceback__) if "jaxbiped" in f.filename]
    last = frames[-1] if frames else traceback.extract_tb(error.__traceback__)[-1]
    where = f"{last.filename.rsplit('/', 1)[-1]}:{last.lineno}"
    return Failure(door, f"{type(error).__name__} at {where}", text.strip()[:160])


def tried(features: Features, doors: tuple[str, ...]) -> tuple[list[Failure], dict[str, str]]:
    """What fails of a draw, and how each door ended."""
    failures, ends = [], {}

    def enter(name: str, call: Callable[[], Any]) -> Any:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            try:
                found = call()
            except Exception as error:
                if (failure := _told(name, error)) is not None:
                    failures.append(failure)
                ends[name] = f"{type(error).__name__}: {str(error)[:70]}"
                return None
        ends[name] = str(found)[:60] if isinstance(found, str) else "done"
        return found

    scene = enter("scene", lambda: scene_of(features))
    state = None if scene is None else enter("start", lambda: start_of(features, scene))
    if state is None:
        return failures, ends
    wants = lambda name: _wanted(features, name)
    for group in doors:
        for name, call in DOORS[group].items():
            enter(name, lambda call=call: call(scene, state, wants))
    return failures, ends


def smallest(features: Features, failure: Failure, doors: tuple[str, ...]) -> Features:
    """The features without which it would not fail so."""
    left = dict(features)
    for name in [name for name in features if name != "contact"]:
        fewer = {key: value for key, value in left.items() if key != name}
        again, _ = tried(fewer, doors)
        if any(f.kind == failure.kind and f.door == failure.door for f in again):
            left = fewer
    return left


def run(
    seed: int,
    numbers: range,
    doors: tuple[str, ...],
    only: Features | None = None,
    until: float = np.inf,
    shrinks: bool = True,
    verbose: bool = False,
) -> Iterator[tuple[int, Draw, Failure, Features]]:
    """All that fails of some draws; of one kind at one door the first."""
    seen: collections.Counter[tuple[str, str]] = collections.Counter()
    for number in numbers:
        if time.monotonic() > until:
            return
        begun = time.process_time()
        chosen = single(number) if seed == SINGLES else draw(seed, number, doors, only)
        if chosen is None:
            return
        failures, ends = tried(chosen.features, doors)
        if verbose:
            print(f"{number} ({time.process_time() - begun:.1f} s) {chosen}: {ends}", flush=True)
        for failure in failures:
            seen[failure.door, failure.kind] += 1
            if seen[failure.door, failure.kind] == 1:
                left = smallest(chosen.features, failure, doors) if shrinks else chosen.features
                yield number, chosen, failure, left


def main() -> None:
    """Prints what fails."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=np.inf)
    parser.add_argument("--doors", nargs="*", default=["field"])
    parser.add_argument("--only", nargs="*", default=[], help="NAME=VALUE")
    parser.add_argument("--verbose", action="store_true")
    asked = parser.parse_args()
    only: Features = {}
    for each in asked.only:
        name, _, value = each.partition("=")
        only[name] = next(v for v in FEATURES[name] if str(v) == value)
    numbers = range(asked.first, asked.first + asked.count)
    until, count = time.monotonic() + asked.seconds, 0
    for number, _, failure, left in run(
        asked.seed, numbers, tuple(asked.doors), only, until, verbose=asked.verbose
    ):
        count += 1
        told = {name: value for name, value in left.items()}
        print(
            f"FAILED {number} {failure.door}: {failure.kind}: {failure.words}\n    {told}",
            flush=True,
        )
    print(f"{asked.count} draws of seed {asked.seed}: {count} kinds of failure")


if __name__ == "__main__":
    main()
