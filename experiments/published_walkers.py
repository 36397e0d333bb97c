"""Published walkers beside what was printed of them: gaits, multipliers, doublings of the period.

Each row is a number as its source prints it, ours, and their difference; docs/published_walkers.md
has the table. Writes published_walkers.png, doublings of the simplest walker and the compass gait.
"""

import math
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from _experiment import Options, experiment
from _mechanisms import kneed

import jaxbiped as jb
from jaxbiped import plot
from jaxbiped.plot.style import new_figure

PLAIN = dict(parameters=(), radius_sensitivities=False)
SLOPES = {"garcia": (0.008, 0.0185), "goswami": (math.radians(2.8), math.radians(5.3))}
"""Where branches are followed; their first doublings are sought there."""
DOUBLINGS = {"garcia": 1, "goswami": 3}
PROGRAM = {
    "bhounsule": ("0.200161072169750", "-0.199906060087682", "-0.015805473227965"),
    "bhounsule-round": ("0.189472782205104", "-0.239124222551699", "-0.053691703909393"),
}
"""What Bhounsule's program prints of its gaits."""


class Printed(NamedTuple):
    """A number of a source as it is printed there, and which of ours it is."""

    quantity: str
    text: str
    ours: float

    def row(self, walker: str) -> dict[str, Any]:
        """The same beside each other, ours with the digits that are printed, four at least."""
        digits = max(4, len(self.text.partition(".")[2]))
        return {
            "walker": walker,
            "quantity": self.quantity,
            "printed": self.text,
            "ours": f"{self.ours:.{digits}f}",
            "difference": abs(self.ours - float(self.text)),
        }


@experiment
def main(options: Options):
    walkers = {
        "garcia": garcia, "goswami": goswami, "mcgeer": mcgeer,
        "mcgeer-kneed": lambda: multipliers_of(found("mcgeer-kneed")),
        "mcgeer-kneed, rigid": mcgeer_kneed_rigid, "hsu-chen": hsu_chen,
        "rimless-wheel": rimless_wheel, "kuo": kuo,
        **{name: partial(program, name) for name in PROGRAM},
    }  # fmt: skip
    rows = [each.row(name) for name, of in walkers.items() for each in of()]
    names = options.sized(list(DOUBLINGS), list(DOUBLINGS)[:1])
    cascades = {name: cascade_of(name) for name in names}
    rows += [each.row(name) for name in names for each in doublings(name, cascades[name])]
    periods = {
        f"{name}, {gait}": float(found(name, gait).measures.period)
        for name, model in jb.models.MODELS.items()
        for gait in model.starts
    }
    return {"rows": rows, "periods": periods, "picture": draw(options, cascades)}


def found(name, gait="gait"):
    """A model's gait, from the start that the catalogue has."""
    model = jb.models.MODELS[name]
    scene = model.make()
    accuracy = "tight" if isinstance(scene, jb.RigidScene) else "balanced"
    return jb.find_gait(scene, scene.state(**model.starts[gait]), accuracy=accuracy, **PLAIN)


def struck(gait):
    """Angle of the stance leg behind a strike, its rate, and the rate of the other leg."""
    state = gait.measures.state
    return float(state.theta_2), float(state.omega_2), float(state.omega_1)


def moduli(gait):
    """Moduli of the multipliers, the largest first."""
    return np.sort(np.abs(np.asarray(gait.multipliers)))[::-1]


def garcia():
    long, short = (found("garcia", gait) for gait in ("long", "short"))
    theta, rate, swing = struck(long)
    pair = np.asarray(long.multipliers)[0]
    yield Printed("long gait: θ", "0.200310900544287", theta)
    yield Printed("long gait: θ̇", "-0.199832473004977", rate)
    yield Printed("long gait: φ̇", "-0.015822999948318", rate - swing)
    yield Printed("long gait: multipliers, real part", "-0.190099841069", pair.real)
    yield Printed("long gait: multipliers, imaginary part", "0.557598776679", abs(pair.imag))
    yield Printed("short gait: θ", "0.193937369810184", struck(short)[0])
    yield Printed("short gait: θ̇", "-0.203866927442010", struck(short)[1])
    yield Printed("long gait: θ to the order of γ", "0.199529", theta)
    yield Printed("short gait: θ to the order of γ", "0.193974", struck(short)[0])


def goswami():
    gait, slope = found("goswami"), math.radians(3.0)
    theta, rate, swing = struck(gait)
    yield Printed("θ_ns", "-0.3234", -theta - slope)
    yield Printed("θ_s", "0.2187", theta - slope)
    yield Printed("θ̇_ns", "-0.3772", swing)
    yield Printed("θ̇_s", "-1.0918", rate)
    yield Printed("two footsteps: leading multipliers, modulus", "0.332", moduli(gait)[0] ** 2)
    yield Printed("two footsteps: third multiplier", "0.014", moduli(gait)[2] ** 2)


def mcgeer():
    gait = found("mcgeer")
    yield Printed("half the angle between the legs", "0.30", struck(gait)[0])
    yield Printed("period, read in a figure", "2.5", float(gait.measures.period))


def mcgeer_kneed_rigid():
    """On rigid feet, the knees locked from where they are straight until the next leg strikes."""
    scene = jb.RigidScene(kneed(), jb.models.mcgeer(knees=True).ground)
    return multipliers_of(jb.find_gait(scene, **PLAIN))


def multipliers_of(gait):
    multipliers = np.asarray(gait.multipliers)
    pair, real = multipliers[0], multipliers[2:4].real
    yield Printed("leading multipliers: modulus", "0.447", abs(pair))
    yield Printed("leading multipliers: argument", "0.947", abs(np.angle(pair)))
    yield Printed("third multiplier", "0.073", real[0])
    yield Printed("fourth multiplier", "-0.001", real[1])


def hsu_chen():
    gait = found("hsu-chen")
    state, slope = gait.measures.state, float(jb.models.hsu_chen().ground.slope)
    yield Printed("q1", "0.1877", float(state.theta_thigh_2) - slope)
    yield Printed("q2", "-0.2884", float(state.theta_thigh_1) - slope)
    yield Printed("rate of q1", "-1.1014", float(state.omega_thigh_2))
    yield Printed("rate of q2", "-0.0399", float(state.omega_thigh_1))


def rimless_wheel():
    (multiplier,) = np.asarray(found("rimless-wheel").multipliers)
    yield Printed("multiplier", "0.647603013861", multiplier.real)


def kuo():
    theta, rate, _ = struck(found("kuo"))
    (push,) = jb.models.kuo().actuation
    ratio = -float(push.impulse) / (rate * math.tan(theta))
    yield Printed("P̂/(v tan α)", "1.000000000000", ratio)


def program(name):
    theta, rate, swing = struck(found(name))
    return map(Printed, ("q1", "u1", "u2"), PROGRAM[name], (theta, rate, rate - swing))


def cascade_of(name):
    """Branches of a model along the slope from its gait on, each with twice the footsteps."""
    model = jb.models.MODELS[name]
    scene = model.make()
    guess = scene.state(**next(iter(model.starts.values())))
    branch = jb.continue_gait(scene, "slope", bounds=SLOPES[name], guess=guess, accuracy="tight")
    return jb.continuation.doubling_cascade(branch, DOUBLINGS[name])


def doublings(name, cascade):
    printed = {"garcia": ("0.0151",), "goswami": ("4.37", "4.9", "5.01")}[name]
    unit, scale = ("rad", 1.0) if name == "garcia" else ("degrees", math.degrees(1.0))
    for k, (text, slope) in enumerate(zip(printed, cascade.values, strict=True)):
        yield Printed(f"slope of doubling {k + 1}, {unit}", text, scale * float(slope))


def draw(options, cascades):
    figure = new_figure(13.0, 5.2)
    axes = figure.subplots(1, len(cascades), squeeze=False)[0]
    for ax, (name, cascade) in zip(axes, cascades.items(), strict=True):
        plot.branch(cascade.branches, "theta_2", ax=ax)
        ax.set_title(f"{name}: stance angle after a strike")
    return options.save(figure, "published_walkers.png")


if __name__ == "__main__":
    main()
