"""Catalogue of extreme cases: parameters, pairs, laws, starts and questions."""

import dataclasses
import itertools
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from reference.compliant import FRICTION, NORMAL

from .case import Case

RANGES: dict[str, tuple[float, ...]] = {
    "K": tuple(np.geomspace(1e2, 1e12, 21)),
    "c": (0.0, *np.geomspace(1.0, 1e10, 21)),
    "n": (1.0, 1.05, 1.2, 1.5, 1.75, 2.0, 2.25, 2.5, 2.75, 3.0, 3.25, 3.5, 3.75, 4.0),
    "v0": tuple(np.geomspace(1e-9, 1.0, 19)),
    "xi": (0.0, *np.geomspace(1e-2, 1e8, 21)),
    "mu": (0.0, 1e-6, 1e-3, 0.01, 0.05, 0.1, 0.2, 0.3, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0),
    "slope": (-1.5, -1.0, -0.6, -0.3, -0.1, -0.03, 0.0, 0.05, 0.1, 0.2, 0.4, 0.6, 1.0, 1.3, 1.5),
    "hip mass": (0.0, *np.geomspace(1e-6, 1e6, 19)),
    "mass": tuple(np.geomspace(1e-6, 1e6, 19)),
    "inertia": tuple(np.geomspace(1e-6, 1e6, 19)),
    "r": (0.0, 1e-6, 1e-4, 1e-3, 0.01, 0.03, 0.15, 0.2, 0.25, 0.3, 0.35, 0.39, 0.399, 0.4),
    "d": (0.0, 1e-6, 1e-3, 0.02, 0.05, 0.15, 0.2, 0.3, 0.38, 0.4, 0.6, 1.0),
    "size": tuple(np.geomspace(1e-3, 1e3, 13)),
    "g": (0.0, *np.geomspace(1e-3, 1e3, 13)),
}
"""Parameters and their extreme values in SI units; masses, inertia and size by the seed's."""


def parameters_at(name: str, value: float) -> dict[str, float]:
    """The arguments of `seed_scene` that a value of the catalogue stands for."""
    lengths = {"l": 0.4 * value, "d": 0.1 * value, "r": 0.08 * value}
    several = {
        "mu": {"mu_static": value, "mu_kinetic": 0.8 * value},
        "hip mass": {"hip_mass": value},
        "mass": {"m": value, "J": 0.0096 * value},
        "inertia": {"J": 0.0096 * value},
        # Of the same material: mass with the volume.
        "size": lengths | {"m": value**3, "J": 0.0096 * value**5},
    }
    return several.get(name, {name: value})


def singles() -> Iterator[Case]:
    """One parameter at each extreme value, standing and about to strike."""
    for name, values in RANGES.items():
        for value, start in itertools.product(values, ("standing", "striking")):
            value = float(value)
            yield Case(name, {name: value}, parameters_at(name, value), start=start)


def pairs(*, each: int) -> Iterator[Case]:
    """Two parameters at extremes: all corners, and `each` random pairs of values between."""
    random = np.random.default_rng(23)
    for one, other in itertools.combinations(RANGES, 2):
        if parameters_at(one, 1.0).keys() & parameters_at(other, 1.0).keys():
            continue  # they set the same numbers
        ends = itertools.product(*((RANGES[name][0], RANGES[name][-1]) for name in (one, other)))
        drawn = [tuple(random.choice(RANGES[name]) for name in (one, other)) for _ in range(each)]
        for k, values in enumerate((*ends, *drawn)):
            a, b = map(float, values)
            yield Case(
                f"{one}, {other}",
                {one: a, other: b},
                parameters_at(one, a) | parameters_at(other, b),
                start="striking" if k % 2 else "standing",
            )


_HARD: tuple[dict[str, float], ...] = (
    {},
    {"K": 1e10},
    {"c": 0.0},
    {"c": 1e9},
    {"v0": 1e-8},
    {"mu_static": 3.0, "mu_kinetic": 2.0},
    {"slope": 0.5},
    {"hip_mass": 1e3},
)


def laws() -> Iterator[Case]:
    """Every law of each kind with the seed's of the other, under hard parameters."""
    for normal, friction in itertools.product(NORMAL, FRICTION):
        if normal != "ristow-schafer" and friction != "bengisu-akay":
            continue
        for k, parameters in enumerate(_HARD):
            at: dict[str, float | str] = {"normal": normal, "friction": friction, **parameters}
            start = "striking" if k % 2 == 0 else "standing"
            yield Case("laws", at, dict(parameters), normal, friction, start=start)


def starts() -> Iterator[Case]:
    """Starts from high above to deep underground, crossed, spinning and thrown."""
    both, signs = ("standing", "striking"), (1.0, -1.0)

    def case(group: str, value: float, changed: dict[str, float], **options: Any) -> Case:
        return Case(group, {group: value}, changed=changed, **options)

    still = dict(hip_vx=0.0, hip_vz=0.0, omega_1=-0.5, omega_2=-0.5)
    for height in (1e-4, 1e-3, 1e-2, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0):
        falls = math.sqrt(2.0 * height / 9.8)
        for legs in ({}, {"theta_1": 0.0, "theta_2": 0.0}, {"theta_1": 0.3, "theta_2": -0.3}):
            changed = {**still, "height": height, **legs}
            for clears in (True, False):
                yield case("drop [m]", height, changed, clears=clears, duration=falls + 0.03)
    depths = (1e-6, 1e-5, 1e-4, 2e-3, 5e-3, 0.01, 0.02, 0.05, 0.08, 0.1, 0.2, 0.3, 0.39)
    grounds: tuple[dict[str, float], ...] = ({}, {"K": 1e3}, {"c": 0.0}, {"n": 3.0})
    for depth, parameters, start in itertools.product(depths, grounds, both):
        how = dict(parameters=parameters, start=start, duration=0.05)
        yield case("depth [m]", depth, {"height": -depth}, **how)
    angles = (0.0, 1e-9, 0.2, 0.5, 1.0, 1.5, math.pi / 2, 2.0, 3.0, math.pi, 10.0, 1e3)
    for one, other in itertools.product(angles, (-1.5, -0.3, 0.0, 0.3, 1.5, 3.0)):
        changed = {"theta_1": one, "theta_2": other, "height": 1e-3}
        yield case("angles [rad]", one - other, changed, duration=0.05)
    rates = (1e-12, 1e-6, 1.0, 10.0, 30.0, 100.0, 300.0, 1e3)
    legs_moved = (("omega_1",), ("omega_2",), ("omega_1", "omega_2"))
    for rate, sign, start, moved in itertools.product(rates, signs, both, legs_moved):
        changed = dict.fromkeys(moved, sign * rate)
        yield case("leg rate [rad/s]", rate, changed, start=start, duration=0.02)
    speeds, fields = (1e-6, 1.0, 10.0, 100.0), ("hip_vx", "hip_vz")
    for speed, field, sign, start in itertools.product(speeds, fields, signs, both):
        yield case("hip speed [m/s]", speed, {field: sign * speed}, start=start, duration=0.02)


_SCENES: tuple[dict[str, float], ...] = ({}, {"K": 1e9}, {"c": 1e9}, {"v0": 1e-7}, {"xi": 1e6})


def questions() -> Iterator[Case]:
    """Accuracies by name and number, tolerances, fixed steps, solvers, engines and precisions."""
    asked: list[tuple[str, float | str, dict[str, Any]]] = []
    for number in (1e-1, 1e-2, 1e-3, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-12):
        asked.append(("accuracy", number, {"accuracy": number}))
    engines, names = ("lanes", "xla"), ("draft", "balanced", "tight")
    for name, engine in itertools.product(names, engines):
        asked.append((f"accuracy, {engine}", name, {"accuracy": name, "engine": engine}))
    for exponent, engine in itertools.product(range(2, 14), engines):
        rtol = 10.0**-exponent
        asked.append((f"rtol, {engine}", rtol, {"rtol": rtol, "engine": engine}))
    steps = (1e-1, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5, 3e-6, 1e-6)
    for dt, solver in itertools.product(steps, ("rodas4", "rodas5p", "kvaerno3", "euler")):
        more = {"dt": dt, "solver": solver, "max_solver_steps": 1 << 17}
        asked.append((f"dt [s], {solver}", dt, more))
    for solver in ("rodas3p", "rodas4p", "rodas5p", "kvaerno5", "tsit5"):
        asked.append(("solver", solver, {"accuracy": "balanced", "solver": solver}))
    for accuracy in (1e-2, "draft", "balanced"):
        asked.append(("float32", str(accuracy), {"accuracy": accuracy, "dtype": "float32"}))
    for kind, value, how in asked:
        for parameters, start in itertools.product(_SCENES, ("standing", "striking")):
            yield Case(kind, {kind: value}, dict(parameters), start=start, duration=0.03, asked=how)


def by_xla() -> Iterator[Case]:
    """Every third case of one parameter, and each law once, by XLA."""
    number, named = {"accuracy": 1e-4, "engine": "xla"}, {"accuracy": "balanced", "engine": "xla"}
    for cases, every, how in ((singles(), 3, number), (laws(), len(_HARD), named)):
        for case in itertools.islice(cases, 0, None, every):
            yield dataclasses.replace(case, group=f"{case.group}, xla", asked=how)


def long_runs() -> Iterator[Case]:
    """Horizons of up to two hundred seconds."""
    for duration, slope in itertools.product((2.0, 10.0, 50.0, 200.0), (0.012, 0.02, 0.03)):
        yield Case("horizon [s]", {"horizon [s]": duration}, {"slope": slope}, duration=duration)


def catalogue(*, quick: bool = False) -> list[Case]:
    """All cases, the same ones in the same order each time."""
    if quick:
        some = itertools.islice(singles(), 0, None, 9), itertools.islice(starts(), 0, None, 20)
        return list(itertools.chain(*some))
    cases = (singles(), starts(), questions(), long_runs(), pairs(each=8), laws(), by_xla())
    return list({case.key: case for case in itertools.chain(*cases)}.values())
