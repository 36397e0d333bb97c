"""Labels of hybrid systems of one's own, against their maps in closed form and SciPy."""

import json
from typing import Any, NamedTuple

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray
from scipy.integrate import solve_ivp

import jaxbiped as jb
from jaxbiped.hybrid import At, Guard, HybridSystem
from tests.sweep.walkers import gaitless

parameter = jb.laws.parameter
TURN = 2.0 * np.pi


class Bounce(NamedTuple):
    """A ball above a table that vibrates."""

    height: Any
    speed: Any
    phase: Any

    periodic = {"phase": TURN}  # noqa: RUF012
    own_units = {"height": "m", "speed": "m/s", "phase": "rad"}  # noqa: RUF012


class Table(HybridSystem):
    """A ball that bounces on a vibrating table."""

    state_type = Bounce
    gravity: float = parameter("gravity", default=9.81)
    restitution: float = parameter("restitution", default=0.5)
    amplitude: float = parameter("amplitude", default=0.03)
    frequency: float = parameter("angular frequency", default=3.0 * TURN)

    def rates(self, y):
        return Bounce(y.speed, -self.gravity, self.frequency)

    def bounce(self, y):
        table = self.amplitude * self.frequency * jnp.cos(y.phase)
        return y._replace(speed=table - self.restitution * (y.speed - table))

    def guards(self):
        gap = lambda y: y.height - self.amplitude * jnp.sin(y.phase)
        return (Guard("impact", gap, reset=self.bounce),)


class Oscillation(NamedTuple):
    """A driven mass."""

    place: Any
    speed: Any
    phase: Any

    periodic = {"phase": TURN}  # noqa: RUF012


class TwoWells(HybridSystem):
    """Duffing's oscillator with two wells, driven so little that it stays in one of them."""

    state_type = Oscillation
    damping: float = parameter("damping", default=0.25)
    force: float = parameter("amplitude of the force", default=0.05)
    frequency: float = parameter("angular frequency", default=1.2)

    def rates(self, y):
        pull = y.place - y.place**3 - self.damping * y.speed
        return Oscillation(y.speed, pull + self.force * jnp.cos(y.phase), self.frequency)


class Running(NamedTuple):
    """A point mass in flight or on a leg."""

    x: Any
    height: Any
    forward: Any
    upward: Any
    reach: Any
    stands: Any

    cyclic = ("x",)
    modes = ("stands",)


class Runner(HybridSystem):
    """A point mass on a massless spring leg that is put down at a fixed angle."""

    state_type = Running
    stiffness: float = parameter("leg stiffness over mass", default=250.0)
    angle: float = parameter("angle of attack", default=np.deg2rad(68.0))
    gravity: float = parameter("gravity", default=9.81)

    def rates(self, y):
        push = self.stiffness * (1.0 / jnp.sqrt(y.reach**2 + y.height**2) - 1.0)
        push = jnp.where(y.stands > 0.5, push, 0.0)
        turning = jnp.where(y.stands > 0.5, y.forward, 0.0)
        up = push * y.height - self.gravity
        return Running(y.forward, y.upward, push * y.reach, up, turning, 0.0)

    def guards(self):
        return (
            Guard(
                "touchdown",
                lambda y: y.height - jnp.sin(self.angle),
                armed=lambda y: y.stands < 0.5,
                reset=lambda y: y._replace(reach=-jnp.cos(self.angle), stands=1.0),
            ),
            Guard(
                "lift off",
                lambda y: jnp.sqrt(y.reach**2 + y.height**2) - 1.0,
                direction=1,
                armed=lambda y: y.stands > 0.5,
                reset=lambda y: y._replace(reach=0.0, stands=0.0),
            ),
            Guard("fall", lambda y: y.height, ends=True),
        )


APEX = jb.Section(lambda system, y: -y.upward, condition=lambda system, y: y.stands < 0.5)
TABLE = Table()
AXES = {
    "phase": np.linspace(0.0, TURN, 20, endpoint=False) + 0.1,
    "speed": np.linspace(0.6, 3.0, 20),
}


def on_table(table, y):
    return y._replace(height=table.amplitude * np.sin(y.phase))


def bounce_of_period_one(table):
    """The bounce that takes one turn of the table, in closed form."""
    speed = 0.5 * float(table.gravity) * TURN / float(table.frequency)
    share = (1.0 - table.restitution) / (1.0 + table.restitution)
    phase = np.arccos(float(share * speed / (table.amplitude * table.frequency)))
    return on_table(table, Bounce(0.0, speed, phase))


def next_impact(table, height, speed, phase):
    """Duration of a flight, and the state behind the impact: exact but for bisection."""
    g, amplitude, rate = (float(x) for x in (table.gravity, table.amplitude, table.frequency))

    def gap(t):
        return height + speed * t - 0.5 * g * t * t - amplitude * np.sin(phase + rate * t)

    latest = (speed + np.sqrt(speed**2 + 2.0 * g * (height + amplitude))) / g
    times = np.linspace(0.0, 1.0001 * latest, 4000)[1:]
    gaps = gap(times)
    if gaps[0] < 0.0:
        return 0.0, height, speed, phase
    last = int(np.flatnonzero(gaps < 0.0)[0])
    low, high = times[last - 1], times[last]
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if gap(middle) > 0.0 else (low, middle)
    there = phase + rate * high
    own = amplitude * rate * np.cos(there)
    after = own - float(table.restitution) * (speed - g * high - own)
    return high, amplitude * np.sin(there), after, there % TURN


def fate(table, height, speed, phase):
    """What becomes of a bounce, by its map."""
    goal = bounce_of_period_one(table)
    for _ in range(400):
        took, height, speed, phase = next_impact(table, height, speed, phase)
        if took < 1e-6:
            return "chatters"
        off = abs(np.exp(1j * phase) - np.exp(1j * goal.phase)) + abs(speed - goal.speed)
        if off < 1e-5:
            return "periodic period-1"
    return "unresolved"


@pytest.fixture(scope="module")
def labelling():
    return jb.labelling(
        TABLE,
        guess=bounce_of_period_one(TABLE),
        section=At("impact"),
        footsteps=60,
        accuracy=0.02,
    )


@pytest.fixture(scope="module")
def starts():
    return jb.starts.grid(TABLE, AXES, follow=on_table)


@pytest.fixture(scope="module")
def swept(labelling, starts, tmp_path_factory):
    store = tmp_path_factory.mktemp("table") / "labels.zarr"
    jb.sweep(labelling, starts, store=store)
    return xarray.open_zarr(store).load()


@pytest.mark.slow
def test_bounces_are_labelled_as_their_map_in_closed_form_goes(labelling, starts, swept):
    assert labelling.family.rows[0][0].duration == pytest.approx(1.0 / 3.0, rel=1e-9)
    batch = starts.batch(labelling, 0, starts.size)
    truth = np.array([fate(TABLE, *start) for start in zip(*batch.states, strict=True)])
    assert {"chatters", "periodic period-1"} == set(truth)
    found = jb.basins.label_names(swept.label, swept.cycle_footsteps).ravel()
    known = swept.doubt.values.ravel() != jb.basins.Doubt.REMAINS
    assert known.mean() > 0.95
    assert (found == truth)[known].all()


@pytest.mark.slow
def test_tables_figures_and_fractions_use_the_words_of_a_system(swept):
    assert swept.label.attrs["flag_meanings"].split()[0] == "periodic"
    assert json.loads(swept.attrs["settings"])["model"] == "hybrid system"
    shares = jb.basins.fractions(swept.label)
    assert set(shares) == {"periodic", "chatters"}
    assert 0.0 < jb.basins.entropy(swept.label).basin < np.log(2.0)
    figure = jb.plot.basin(swept)
    texts = " ".join(text.get_text() for text in figure.axes[0].get_legend().get_texts())
    assert "periodic period-1" in texts
    assert "chatters" in texts
    plt.close(figure)


@pytest.mark.slow
def test_the_smallest_fatal_push_of_a_bounce_is_on_the_boundary_of_its_map(labelling):
    effort = labelling.effort._replace(wanted=None)
    once = jb.labels.Labelling(TABLE, labelling.family, effort)
    shock = jb.labels.nearest_failure(once, tolerance=1e-4)
    start = np.array(bounce_of_period_one(TABLE))
    ends = [fate(TABLE, *(start + share * shock.push)) for share in (0.99, 1.01)]
    assert ends == ["periodic period-1", "chatters"]


@pytest.mark.slow
def test_cycles_in_two_wells_are_told_apart():
    system = TwoWells()
    starts = jb.starts.grid(
        system, {"place": np.linspace(-1.6, 1.6, 13), "speed": np.linspace(-1.5, 1.5, 13)}
    )
    known = jb.labelling(system, guess=Oscillation(1.0, 0.0, 0.0), footsteps=100)
    assert known.effort.section == At("phase")
    both = jb.labels.with_gaits_met(known, starts)
    wells = np.array([np.sign(gait.state.place) for gait in both.family.rows[0]])
    assert sorted(wells) == [-1.0, 1.0]
    states = starts.batch(both, 0, starts.size).states
    n = starts.size

    def rates(t, y):
        x, v = y[:n], y[n:]
        return np.concatenate([v, x - x**3 - 0.25 * v + 0.05 * np.cos(1.2 * t)])

    end = solve_ivp(
        rates, (0.0, 300.0), np.concatenate([states.place, states.speed]), rtol=1e-9, atol=1e-11
    ).y[:n, -1]
    found = both(states)
    assert set(found.names) == {"periodic period-1"}
    np.testing.assert_array_equal(wells[found.gait], np.sign(end))


def run(runner, height, steps=20):
    """Whether a run falls, and where, by SciPy: flights in closed form and stances by DOP853."""
    k, g, angle = (float(x) for x in (runner.stiffness, runner.gravity, runner.angle))
    x, z, u, w = 0.0, height, 5.0, 0.0

    def stance(t, y):
        push = k * (1.0 / np.hypot(y[0], y[1]) - 1.0)
        return [y[2], y[3], push * y[0], push * y[1] - g]

    lifts, falls = (lambda t, y: np.hypot(y[0], y[1]) - 1.0), (lambda t, y: y[1])
    for event, way in ((lifts, 1.0), (falls, -1.0)):
        event.terminal, event.direction = True, way
    for _ in range(steps):
        highest = z + max(w, 0.0) ** 2 / (2.0 * g)
        drop = 0.0 if highest < np.sin(angle) else np.sin(angle)
        time = (w + np.sqrt(w * w + 2.0 * g * (z - drop))) / g
        x, w = x + u * time, w - g * time
        if drop == 0.0:
            return True, x
        start = [-np.cos(angle), np.sin(angle), u, w]
        found = solve_ivp(
            stance, (0.0, 9.0), start, method="DOP853", events=(lifts, falls), rtol=1e-11,
            atol=1e-12,
        )  # fmt: skip
        reach, z, u, w = found.y[:, -1]
        x += reach + np.cos(angle)
        if len(found.t_events[1]):
            return True, x
    return False, x


@pytest.mark.slow
def test_a_system_ends_as_its_guards_are_named():
    runner = Runner()
    heights = np.linspace(0.9, 1.3, 9)
    still = np.zeros_like(heights)
    start = Running(0.0, 1.0, 5.0, 0.0, 0.0, 0.0)
    known = gaitless(runner, start, section=APEX, footsteps=20)
    found = known(Running(still, heights, still + 5.0, still, still, still))
    truth = [run(runner, height) for height in heights]
    falls = np.array([has_fallen for has_fallen, _ in truth])
    assert 0 < falls.sum() < len(falls)
    np.testing.assert_array_equal(found.label == 100, falls)
    assert set(found.names[falls]) == {"fall"}
    assert set(found.names[~falls]) == {"unresolved"}
    fallen = np.array([x for _, x in truth])[falls]
    np.testing.assert_allclose(found.distance[falls], fallen, rtol=1e-4)


def test_what_a_system_or_a_walker_does_not_take_is_refused():
    scene = jb.seed_scene()
    with pytest.raises(jb.ArgumentError, match="section"):
        jb.labelling(scene, section=jb.MidStance())
    with pytest.raises(jb.ArgumentError, match="guess = None"):
        jb.labelling(TABLE)
    with pytest.raises(jb.ArgumentError, match="guard"):
        jb.labelling(TABLE, guess=bounce_of_period_one(TABLE), section=At("floor"))
    with pytest.raises(jb.ArgumentError, match="place"):
        jb.starts.grid(TABLE, AXES, place=True)
    with pytest.raises(jb.ArgumentError, match="ending that a hybrid system names"):
        jb.basins.fractions([0, 100])
    assert jb.basins.label_name(100, endings=("fall",)) == "fall"
    assert jb.basins.label_name(0, 2, endings=()) == "periodic period-2"
