"""The woodpecker toy's limit cycle against SciPy, Glocker and Studer's start, and Siconos's run."""

import numpy as np
import pytest
from _woodpecker import Woodpecker, WoodpeckerToy
from scipy.integrate import solve_ivp

import jaxbiped as jb
from jaxbiped.hybrid import At

pytestmark = pytest.mark.nightly

TILT = 0.0006 / 0.0058
START = Woodpecker(0.0, -TILT, -0.2788, -0.3411, 0.0, -7.4583, -1.0, -1.0)
"""Where Siconos's example begins, as do cardillo's and Rible.jl's: the bird at -0.2788 rad."""
SICONOS = {  # Woodpecker.ref: time, height, its rate, the bird's angle and its rate, steps of 20 us
    1: [
        (
            0.14610,
            -1.950349130201238e-2,
            -3.399305974279318e-1,
            -2.787469231135298e-1,
            -7.458724086,
        ),
        (
            0.14612,
            -1.951028849233950e-2,
            -3.397884352844787e-1,
            -2.788961162715229e-1,
            -7.460591713,
        ),
    ],
    2: [
        (
            0.29208,
            -3.894849566802954e-2,
            -3.394835725245758e-1,
            -2.787380492490395e-1,
            -7.461830687,
        ),
        (
            0.29210,
            -3.895528391830334e-2,
            -3.393414548546180e-1,
            -2.788873045365897e-1,
            -7.463698068,
        ),
    ],
}
PASSES_DOWN = jb.Section(lambda s, y: -0.2788 - y.bird, condition=lambda s, y: y.slip < 0.0)


class Peer:
    """The toy by SciPy: a mass matrix, and every contact open, sticking or sliding, in turn."""

    mass = np.array(
        [[4.8e-3, 4.5e-5, 6.75e-5], [4.5e-5, 4.55e-7, 6.75e-7], [6.75e-5, 6.75e-7, 1.7125e-6]]
    )
    spring = 0.0056 * np.array([[0.0, 0.0, 0.0], [0.0, 1.0, -1.0], [0.0, -1.0, 1.0]])
    weight = -9.81 * np.array([4.8e-3, 4.5e-5, 6.75e-5])
    # The beak, the lower and the upper edge.
    openings = np.array([0.0024, 0.0006, 0.0006])
    normals = np.array([[0.0, 0.0, -0.02], [0.0, 0.0058, 0.0], [0.0, -0.0058, 0.0]])
    tangents = np.array([[1.0, 0.01, -0.0051], [1.0, 0.0031, 0.0], [1.0, 0.0031, 0.0]])
    restitutions, friction = np.array([0.5, 0.0, 0.0]), 0.3

    def motion(self, free, rates, contact, how):
        """Rates of the coordinates, pressure and friction, where a contact is in a mode."""
        if how == "open":
            return free, 0.0, 0.0
        n, t = self.normals[contact], self.tangents[contact]
        if how == "sticks":
            columns, rows, wanted = np.column_stack([n, t]), np.stack([n, t]), (rates, 0.0)
        else:
            drag = -self.friction if how == "up" else self.friction
            columns, rows, wanted = (n + drag * t)[:, None], n[None], (rates,)
        by = np.linalg.solve(self.mass, columns)
        forces = np.linalg.solve(rows @ by, wanted - rows @ free)
        return free + by @ forces, forces[0], forces[1] if how == "sticks" else drag * forces[0]

    def allowed(self, free, contact, slides, wanted=0.0):
        """The one mode in which contact and friction obey their laws.

        Args:
            free: rates without the contact.
            slides: sliding speed before, by which it slides on; 0: it rests; None: an impact.
            wanted: the opening's rate where it is closed.
        """
        fits = []
        for how in ("open", "sticks", "up", "down"):
            after, pressure, drag = self.motion(free, wanted, contact, how)
            sliding = slides or self.tangents[contact] @ after
            up = sliding > 0.0
            obeys = {
                "open": self.normals[contact] @ after >= wanted,
                "sticks": not slides and abs(drag) <= self.friction * pressure,
                "up": pressure > 0.0 and up,
                "down": pressure > 0.0 and not up,
            }[how]
            if obeys:
                fits.append(how)
        (one,) = fits
        return one

    def forces(self, y, contact, how):
        free = np.linalg.solve(self.mass, self.weight - self.spring @ y[:3])
        return self.motion(free, 0.0, contact, how)

    def events(self, contact, how):
        """What ends a mode: names, functions and directions."""
        for k, name in enumerate(("beak", "lower edge", "upper edge")):
            if k != contact:
                yield name, lambda t, y, k=k: self.openings[k] + self.normals[k] @ y[:3], -1
        if contact is not None:
            yield "lifts", lambda t, y: self.forces(y, contact, how)[1], -1
        if how in ("up", "down"):
            yield "sticks", lambda t, y: y[3], -1 if how == "up" else 1
        if how == "sticks":

            def cone(t, y):
                _, pressure, drag = self.forces(y, contact, how)
                return self.friction * pressure - abs(drag)

            yield "slips", cone, -1

    def cycle(self, bird, bird_rate):
        """From where the lower edge sticks to there: times, names of events, and the last state."""
        t, y, contact, how = 0.0, np.array([0.0, -TILT, bird, 0.0, 0.0, bird_rate]), 1, "sticks"
        log = []
        while t < 1.0:
            names, functions, directions = zip(*self.events(contact, how), strict=True)
            for function, direction in zip(functions, directions, strict=True):
                function.terminal, function.direction = True, direction

            def field(t, y, contact=contact, how=how):
                return np.concatenate([y[3:], self.forces(y, contact, how or "open")[0]])

            run = solve_ivp(
                field,
                (t, 1.0),
                y,
                "DOP853",
                events=functions,
                rtol=1e-10,
                atol=1e-14,
                max_step=1e-3,
            )
            (name,) = (n for n, times in zip(names, run.t_events, strict=True) if len(times))
            t, y = run.t[-1], run.y[:, -1].copy()
            log.append((t, name))
            contact, how = self.after(name, y, contact, how)
            if (name, contact, how) == ("sticks", 1, "sticks"):
                return log, y
        raise AssertionError(log)

    def after(self, name, y, contact, how):
        """The contact and its mode behind an event, whose impact changes the state in place."""
        if name == "lifts":
            return None, None
        if name == "slips":  # against the friction that does not hold any more
            return contact, "down" if self.forces(y, contact, how)[2] > 0.0 else "up"
        slides = 0.0
        if name == "sticks":
            y[3] = 0.0
        else:
            struck = ("beak", "lower edge", "upper edge").index(name)
            assert contact is None
            back = -self.restitutions[struck] * (self.normals[struck] @ y[3:])
            mode = self.allowed(y[3:], struck, None, wanted=back)
            y[3:] = self.motion(y[3:], back, struck, mode)[0]
            if struck == 0:
                return None, None
            contact, y[1], y[4] = struck, (-TILT if struck == 1 else TILT), 0.0
            slides = 0.0 if mode == "sticks" else y[3]
        free = self.forces(y, contact, "open")[0]
        how = self.allowed(free, contact, slides)
        return (None, None) if how == "open" else (contact, how)


@pytest.fixture(scope="module")
def gait():
    sticks = jb.simulate(WoodpeckerToy(), START, duration=0.2, save=At("sticks"), max_arrivals=2)
    guess = Woodpecker(*(float(leaf[1]) for leaf in sticks.arrivals.state))
    return jb.find_gait(WoodpeckerToy(), guess, section=At("sticks"), accuracy="tight")


@pytest.fixture(scope="module")
def passage(gait):
    """The limit cycle where the bird passes -0.2788 rad as the sleeve slides down."""
    walk = jb.simulate(
        WoodpeckerToy(),
        gait.state,
        duration=0.15,
        save=PASSES_DOWN,
        max_arrivals=1,
        accuracy="tight",
    )
    return [float(leaf[0]) for leaf in walk.arrivals.state]


def test_the_limit_cycle_is_that_of_scipy(gait):
    log, end = Peer().cycle(float(gait.state.bird), float(gait.state.bird_rate))
    measures = gait.measures
    assert log[-1][0] == pytest.approx(float(measures.period), rel=1e-8)
    assert end[0] == pytest.approx(float(measures.step_length), rel=1e-8)
    np.testing.assert_allclose(end[[2, 5]], [gait.state.bird, gait.state.bird_rate], rtol=1e-8)


def test_its_lower_edge_strikes_twice_when_it_does_in_scipy(gait):
    log, _ = Peer().cycle(float(gait.state.bird), float(gait.state.bird_rate))
    times = [time for time, event in log if event == "lower edge"]
    duration = 0.99 * float(gait.measures.period)
    options = {"save": At("lower edge"), "max_arrivals": 3, "accuracy": "tight"}
    walk = jb.simulate(WoodpeckerToy(), gait.state, duration=duration, **options)
    assert [float(t) for t in walk.arrivals.t] == pytest.approx([*times, np.inf], abs=1e-9)


def test_its_multiplier_is_that_of_scipy(gait):
    place, rate = float(gait.state.bird), float(gait.state.bird_rate)
    # What sticks forgets all but its energy: the map has rank 1, and its trace is the multiplier.
    ends = {h: Peer().cycle(place + h, rate)[1] for h in (-1e-5, 1e-5)}
    by_place = (ends[1e-5][2] - ends[-1e-5][2]) / 2e-5
    ends = {h: Peer().cycle(place, rate + h)[1] for h in (-1e-3, 1e-3)}
    by_rate = (ends[1e-3][5] - ends[-1e-3][5]) / 2e-3
    multipliers = np.sort(np.abs(gait.multipliers))
    assert float(gait.multipliers[0].real) == pytest.approx(by_place + by_rate, abs=1e-5)
    assert multipliers[:-1] == pytest.approx(0.0, abs=1e-9)


def test_the_published_start_lies_near_the_limit_cycle(passage):
    _, _, bird, speed, _, bird_rate, *_ = passage
    assert bird == pytest.approx(START.bird, abs=1e-9)
    assert speed == pytest.approx(START.speed, rel=0.006)
    assert bird_rate == pytest.approx(START.bird_rate, rel=0.001)


def test_the_period_and_the_fall_are_those_of_siconos(gait, passage):
    first, second = (_at_angle(*SICONOS[k]) for k in (1, 2))
    period, fall, *_ = second - first
    assert float(gait.measures.period) == pytest.approx(period, rel=1e-4)
    assert float(gait.measures.step_length) == pytest.approx(fall, rel=1e-4)
    # Its second passage, on the other side of the cycle than the first: the multiplier is negative.
    assert passage[3] == pytest.approx(second[2], rel=1e-3)
    assert passage[5] == pytest.approx(second[4], rel=1e-3)
    assert (second[2] - passage[3]) * (first[2] - passage[3]) < 0.0


def _at_angle(before, after):
    before, after = np.array(before), np.array(after)
    return before + (-0.2788 - before[3]) / (after[3] - before[3]) * (after - before)
