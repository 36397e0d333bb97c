"""Hybrid systems of one's own through every door, against truths from outside."""

import dataclasses
from typing import Any, NamedTuple

import _hybrid_systems as systems
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import jaxbiped as jb

At, Guard = jb.hybrid.At, jb.hybrid.Guard
BALL = systems.BouncingBall()


@pytest.fixture(scope="module")
def bounce():
    return jb.find_gait(BALL, BALL.one_period())


def moved(system, state, duration, **options):
    return jb.simulate(system, state, duration=duration, **options)


def fallen_ball(ball, state, count):
    """Times and speeds behind so many impacts, by SciPy."""
    e, g, a, w = (
        float(getattr(ball, n)) for n in ("restitution", "gravity", "amplitude", "frequency")
    )

    def gap(t, y):
        return y[0] - a * np.sin(w * t + float(state.phase))

    gap.terminal, gap.direction = True, -1
    t, y, told = 0.0, [float(state.height), float(state.speed)], []
    for _ in range(count):
        flight = solve_ivp(
            lambda t, y: [y[1], -g], (t, t + 5.0), y, events=gap, rtol=1e-12, atol=1e-14
        )
        t, (height, speed) = flight.t[-1], flight.y[:, -1]
        table = a * w * np.cos(w * t + float(state.phase))
        y = [height, table - e * (speed - table)]
        told.append((t, y[1]))
    return np.array(told).T


@pytest.mark.parametrize("solver", ["rodas4p", "dopri8"])
def test_steps_of_one_size_land_on_guards(solver):
    """They are as long as asked but where they are cut by an impact, and meet it as exactly."""
    start, dt = systems.Bounce(0.1, 0.0, 1.0), 0.01
    times, speeds = fallen_ball(BALL, start, 5)
    how = dict(solver=solver, dt=dt)
    walk = moved(BALL, start, 1.2, save=At("impact"), **how)
    np.testing.assert_allclose(walk.arrivals.t[:5], times, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(walk.arrivals.state.speed[:5], speeds, rtol=0.0, atol=1e-8)
    assert int(walk.missed_contacts) == 0
    steps = np.asarray(moved(BALL, start, 0.25, save="steps", **how).t)
    grid = dt * np.arange(26)
    np.testing.assert_allclose(steps[np.argmin(np.abs(steps - grid[:, None]), axis=1)], grid)
    assert np.max(np.diff(steps)) < dt * (1.0 + 1e-12)


def test_impacts_come_when_and_as_they_should():
    start = systems.Bounce(0.1, 0.0, 1.0)
    times, speeds = fallen_ball(BALL, start, 5)
    walk = moved(BALL, start, 1.2, save=At("impact"))
    np.testing.assert_allclose(walk.arrivals.t[:5], times, rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(walk.arrivals.state.speed[:5], speeds, rtol=0.0, atol=1e-9)
    assert walk.engine == "lanes"
    phases = (1.0 + float(BALL.frequency) * times) % (2.0 * np.pi)
    np.testing.assert_allclose(walk.arrivals.state.phase[:5], phases, rtol=0.0, atol=1e-10)


def test_every_step_has_both_sides_of_each_impact():
    start = systems.Bounce(0.1, 0.0, 1.0)
    times, _ = fallen_ball(BALL, start, 3)
    walk = moved(BALL, start, 0.26)
    assert np.all(np.diff(walk.t) >= 0.0)
    twice = walk.t[np.flatnonzero(np.diff(walk.t) == 0.0)]
    for time in times:
        assert np.min(np.abs(twice - time)) < 1e-11
    between = walk.at(0.5 * times[0])
    np.testing.assert_allclose(
        between.height, 0.1 - 0.5 * float(BALL.gravity) * (0.5 * times[0]) ** 2, rtol=1e-12
    )
    saved = moved(BALL, start, 0.26, save=np.array([0.1, 0.2, 0.26]))
    for name in systems.Bounce._fields:
        told = getattr(walk.at(np.array([0.1, 0.2])), name)
        np.testing.assert_allclose(getattr(saved.state, name)[:2], told, rtol=0.0, atol=1e-12)


def test_xla_runs_the_same_motion():
    start = systems.Bounce(0.1, 0.0, 1.0)
    lanes, xla = (moved(BALL, start, 0.26, save="end", engine=e) for e in ("lanes", "xla"))
    assert xla.engine == "xla"
    np.testing.assert_allclose(xla.final, lanes.final, rtol=0.0, atol=1e-11)


def test_derivatives_of_a_bouncing_motion():
    """Of an end behind two impacts, and of an impact's time and state, against differences."""
    start = BALL.one_period()._replace(speed=1.7)

    def end(restitution, speed):
        ball = dataclasses.replace(BALL, restitution=restitution)
        return jnp.stack(moved(ball, start._replace(speed=speed), 0.75, save="end").final)

    def impact(speed):
        walk = moved(BALL, start._replace(speed=speed), 0.75, save=At("impact"), max_arrivals=2)
        return jnp.stack([walk.arrivals.t, walk.arrivals.state.speed])

    h = 1e-5
    slopes = jax.jacfwd(end, argnums=(0, 1))(0.5, 1.7)
    told = [(end(0.5 + h, 1.7) - end(0.5 - h, 1.7)) / (2 * h)]
    told += [(end(0.5, 1.7 + h) - end(0.5, 1.7 - h)) / (2 * h)]
    np.testing.assert_allclose(np.stack(slopes), np.stack(told), rtol=1e-6, atol=1e-6)
    differences = (impact(1.7 + h) - impact(1.7 - h)) / (2 * h)
    np.testing.assert_allclose(jax.jacfwd(impact)(1.7), differences, rtol=1e-6, atol=1e-6)


def test_the_orbit_of_a_bouncing_ball_is_the_one_in_closed_form(bounce):
    """Its period, state and multipliers, and derivatives of state and radius; e is the radius."""
    truth, e = BALL.one_period(), float(BALL.restitution)
    np.testing.assert_allclose(bounce.state, truth, rtol=0.0, atol=1e-12)
    period = 2.0 * np.pi / float(BALL.frequency)
    np.testing.assert_allclose(bounce.measures.period, period, rtol=1e-14)
    np.testing.assert_allclose(np.prod(bounce.multipliers), e**2, rtol=1e-9)
    place = bounce.parameters.index("restitution")
    np.testing.assert_allclose(bounce.sensitivities.spectral_radius[place], 1.0, rtol=1e-7)
    moved = [dataclasses.replace(BALL, restitution=e + h).one_period() for h in (1e-5, -1e-5)]
    phase = (moved[0].phase - moved[1].phase) / 2e-5
    np.testing.assert_allclose(bounce.sensitivities.state.phase[place], phase, rtol=1e-7)
    assert bounce.cycle == "cycle"
    assert bounce.measures.speed is None


def test_its_branch_has_the_fold_and_the_doubling_in_closed_form(bounce):
    e, w, g = (float(getattr(BALL, name)) for name in ("restitution", "frequency", "gravity"))
    branch = jb.continue_gait(BALL, "amplitude", bounds=(0.02, 0.06), guess=bounce)
    fold, doubling = branch.bifurcations
    least = (1.0 - e) / (1.0 + e) * np.pi * g / w**2
    np.testing.assert_allclose(fold.value, least, rtol=1e-12)
    leaned = 2.0 * g * (1.0 + e**2) / (1.0 + e) ** 2 / w**2
    np.testing.assert_allclose(doubling.value, np.hypot(least, leaned), rtol=1e-9)
    again = jb.continuation.open_branch(branch.to_dataset(), BALL)
    np.testing.assert_array_equal(again.values, branch.values)


def _amplitudes(e, w, g):
    """The amplitudes of the fold and of the doubling of one impact in a period."""
    least = (1.0 - e) / (1.0 + e) * jnp.pi * g / w**2
    return least, jnp.hypot(least, 2.0 * g * (1.0 + e**2) / (1.0 + e) ** 2 / w**2)


def test_what_becomes_of_its_bifurcations_is_as_in_closed_form(bounce):
    own = {name: float(getattr(BALL, name)) for name in ("restitution", "frequency", "gravity")}
    fold, doubling = _amplitudes(*own.values())
    nearest = jb.continuation.nearest_bifurcation(BALL, bounce, "amplitude")
    assert str(nearest.kind) == "fold"
    np.testing.assert_allclose(nearest.value, fold, rtol=1e-8)
    branch = jb.continue_gait(BALL, "amplitude", bounds=(0.02, 0.06), guess=bounce)
    at = dict(zip(("fold", "period-doubling"), branch.bifurcations, strict=True))
    for k, (kind, point) in enumerate(at.items()):
        assert str(point.kind) == kind
        told = jb.continuation.bifurcation_sensitivities(branch, point, tuple(own))
        slopes = jax.jacfwd(lambda x, k=k: _amplitudes(*x)[k])(jnp.array([*own.values()]))
        np.testing.assert_allclose(told.slopes, slopes, rtol=1e-5)
    curve = jb.continuation.bifurcation_curve(
        branch, at["fold"], "restitution", bounds=(0.45, 0.55), max_points=8
    )
    e = curve.values[:, 1]
    least, _ = _amplitudes(e, own["frequency"], own["gravity"])
    np.testing.assert_allclose(curve.values[:, 0], least, rtol=1e-8)
    assert np.ptp(e) > 0.04
    cascade = jb.continuation.doubling_cascade(branch)
    np.testing.assert_allclose(cascade.values[0], doubling, rtol=1e-8)
    assert len(cascade.values) >= 4
    assert 4.5 < cascade.ratios[-1] < 4.8  # Feigenbaum's number is 4.669
    with pytest.raises(jb.ArgumentError, match="it must be a Scene or a RigidScene"):
        jb.continuation.find_isolated(BALL)


def test_a_sweep_a_fit_and_an_optimum_of_it(bounce, tmp_path):
    swept = jb.gait_sweep(
        BALL, {"restitution": [0.5, 0.52]}, guess=bounce, parameters=(), radius_sensitivities=False
    )
    np.testing.assert_allclose(swept.spectral_radius, [0.5, 0.52], rtol=1e-9)
    seen = jb.identify.MeasuredGait({"state_speed": (1.65, 1e-3)})
    fit = jb.fit_gait(BALL, ("gravity",), seen, guess=bounce)
    period = 2.0 * np.pi / float(BALL.frequency)
    np.testing.assert_allclose(fit.estimates["gravity"], 2.0 * 1.65 / period, rtol=1e-9)
    for _ in range(2):  # the second time from what the first one kept
        best = jb.optimise_gait(
            BALL,
            vary={"restitution": (0.45, 0.52)},
            maximise="spectral_radius",
            guess=bounce,
            store=tmp_path / "designs",
        )
        np.testing.assert_allclose(best.objective, 0.52, rtol=1e-9)
    for result in (bounce, BALL):
        jb.save(tmp_path / "kept", result)
        loaded = jb.load(tmp_path / "kept")
        np.testing.assert_array_equal(*(jax.tree.leaves(x)[0] for x in (loaded, result)))


def test_a_driven_oscillator_strikes_its_stop_as_scipy_has_it():
    """The orbit's return, and its multipliers' product, r² exp(−2ζT)."""
    system = systems.ImpactOscillator()
    gait = jb.find_gait(
        system, systems.Oscillation(1.461, -1.0842, 0.0), section=At("phase"), accuracy="tight"
    )
    zeta, force, w, stop, r = jax.tree.leaves(jax.tree.map(float, system))

    def field(t, y):
        return [y[1], force * np.cos(w * t) - y[0] - 2.0 * zeta * y[1]]

    def gap(t, y):
        return stop - y[0]

    gap.terminal, gap.direction = True, -1
    period = 2.0 * np.pi / w
    t, y = 0.0, [float(gait.state.place), float(gait.state.speed)]
    while t < period:
        leg = solve_ivp(field, (t, period), y, events=gap, rtol=1e-12, atol=1e-13, method="DOP853")
        t, y = leg.t[-1], leg.y[:, -1].tolist()
        if leg.status == 1:
            y[1] *= -r
    np.testing.assert_allclose(y, gait.state[:2], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(gait.measures.period, period, rtol=1e-13)
    product = np.prod(gait.multipliers)
    np.testing.assert_allclose(product, r**2 * np.exp(-2.0 * zeta * period), rtol=1e-8)


def test_an_orbit_that_grazes_the_stop_is_told():
    """The map has a root's singularity there: no derivative is told."""
    system = systems.ImpactOscillator()
    touching = dataclasses.replace(system, stop=system.response())
    w, zeta = float(system.frequency), float(system.damping)
    place, speed = _response(system)
    start = systems.Oscillation(place, speed, 0.0)
    with pytest.warns(RuntimeWarning, match="grazes"):
        gait = jb.find_gait(touching, start, section=At("phase"))
    assert int(gait.grazes) > 0
    assert np.all(np.isnan(gait.sensitivities.state.place))
    clear = dataclasses.replace(system, stop=1.01 * system.response())
    free = jb.find_gait(clear, start, section=At("phase"))
    assert int(free.grazes) == 0
    shrink = np.exp(-zeta * 2.0 * np.pi / w)
    np.testing.assert_allclose(free.measures.spectral_radius, shrink, rtol=1e-6)


def _response(system):
    """Place and speed of the motion that strikes nothing, where the force is largest."""
    zeta, force, w = (float(getattr(system, n)) for n in ("damping", "force", "frequency"))
    z = force / complex(1.0 - w**2, 2.0 * zeta * w)
    return z.real, (1j * w * z).real


def test_stick_and_slip_take_the_time_that_radau_has():
    system = systems.BeltFriction()
    gait = jb.find_gait(system, systems.Sliding(1.0, 0.2, 0.0), section=At("slips"))
    belt, static, rate = jax.tree.leaves(jax.tree.map(float, system))

    def slip(t, y):
        return [y[1], static / (1.0 + rate * (belt - y[1])) - y[0]]

    def catches(t, y):
        return belt - y[1] if t > 0.1 else 1.0

    catches.terminal, catches.direction = True, -1
    leg = solve_ivp(
        slip, (0.0, 20.0), [static, belt], "Radau", events=catches, rtol=1e-11, atol=1e-12
    )
    period = leg.t[-1] + (static - leg.y[0, -1]) / belt
    np.testing.assert_allclose(gait.measures.period, period, rtol=1e-7)
    np.testing.assert_allclose(gait.multipliers, 0.0, atol=1e-9)


def test_a_spring_legs_energy_is_kept_and_its_multiplier_is_1():
    system = systems.SpringLegRunner()
    start = systems.Running(0.0, 1.0, 5.0, 0.0, 0.0, 0.0)
    walk = moved(system, start, 3.0, save=systems.APEX, accuracy="tight")
    assert int(walk.arrivals.total) > 5
    apexes = jax.tree.map(lambda leaf: leaf[: int(walk.arrivals.total)], walk.arrivals.state)
    np.testing.assert_allclose(system.energy(apexes), system.energy(start), rtol=1e-10)
    gait = jb.find_gait(system, start, section=systems.APEX, parameters=())
    assert str(gait.outcome) == "found"
    np.testing.assert_allclose(np.abs(gait.multipliers[0]), 1.0, atol=1e-6)
    assert np.abs(gait.multipliers[1]) < 1.0
    low = jb.simulate(system, start._replace(height=0.93, forward=1.0), duration=3.0, save="end")
    assert str(low.outcome) == "fell"


def test_a_relays_half_period_is_ln_3_and_its_multiplier_1_27th():
    gait = jb.find_gait(
        systems.RelayFeedback(),
        systems.Relayed(0.1, 0.0, -1.0),
        section=At("falls"),
        accuracy="tight",
    )
    np.testing.assert_allclose(gait.measures.period, np.log(3.0), rtol=1e-10)
    np.testing.assert_allclose(gait.state, (0.5, 0.4, -1.0), rtol=0.0, atol=1e-9)
    # Åström: (I − v C / C v) exp(A T), v the velocity as the relay switches.
    flow, normal = expm(np.diag([-1.0, -2.0]) * np.log(3.0)), np.array([1.0, -1.0])
    velocity = np.array([-1.0 + 0.5, -1.0 + 0.8])
    matrix = (np.eye(2) - np.outer(velocity, normal) / (normal @ velocity)) @ flow
    leading = np.max(np.abs(np.linalg.eigvals(matrix)))
    np.testing.assert_allclose(gait.measures.spectral_radius, leading, rtol=1e-9)
    np.testing.assert_allclose(leading, 1.0 / 27.0, rtol=1e-12)


def test_van_der_pols_relaxation_oscillation():
    """Radau's period at a relative tolerance of 1e-12 is 1614.40112581."""
    system = systems.VanDerPol()
    gait = jb.find_gait(
        system, systems.Voltage(1.5, -0.001), section=systems.RELAXED, accuracy="tight"
    )
    period = float(gait.measures.period)
    assert abs(period - 1614.40112581) < max(2e-6, float(gait.measure_errors.period))
    mu = float(system.mu)
    assert abs(period - system.asymptotic_period()) < np.log(mu) / mu


class Scaled(NamedTuple):
    """A ball in other units."""

    height: Any
    speed: Any
    phase: Any

    periodic = systems.Bounce.periodic
    scales = {"height": 1e-9, "speed": 1e-9 / 1e-15}  # noqa: RUF012


class FastBall(systems.BouncingBall):
    """The ball with lengths of nanometres and times of femtoseconds."""

    state_type = Scaled
    time_unit = 1e-15

    def rates(self, y):
        return Scaled(y.speed, -self.gravity, self.frequency)

    def guards(self):
        return (Guard("impact", self.gap, reset=self.bounce, scale=1e-9),)


def test_units_of_length_and_time_make_no_difference(bounce):
    length, time = 1e-9, 1e-15
    fast = FastBall(
        gravity=9.81 * length / time**2,
        restitution=0.5,
        amplitude=0.03 * length,
        frequency=6.0 * np.pi / time,
    )
    start = Scaled(*fast.one_period())
    gait = jb.find_gait(fast, start)
    np.testing.assert_allclose(gait.measures.period / time, bounce.measures.period, rtol=1e-12)
    np.testing.assert_allclose(gait.state.speed * time / length, bounce.state.speed, rtol=1e-9)
    np.testing.assert_allclose(gait.multipliers, bounce.multipliers, rtol=1e-7)
    walk = moved(fast, Scaled(0.1 * length, 0.0, 1.0), 1.2 * time, save=At("impact"))
    slow = moved(BALL, systems.Bounce(0.1, 0.0, 1.0), 1.2, save=At("impact"))
    np.testing.assert_allclose(walk.arrivals.t[:4] / time, slow.arrivals.t[:4], rtol=1e-10)


def test_a_clock_keeps_its_digits():
    """After thousands of periods a phase is as exact as at first."""
    still = dataclasses.replace(systems.ImpactOscillator(), stop=100.0)
    walk = moved(still, systems.Oscillation(0.0, 0.0, 0.0), 2e4, save="end", max_solver_steps=10**7)
    assert str(walk.outcome) == "finished"
    phase = (float(still.frequency) * 2e4) % (2.0 * np.pi)
    np.testing.assert_allclose(walk.final.phase, phase, rtol=0.0, atol=1e-6)
    place, speed = _response(still)
    z = complex(place, -speed / float(still.frequency)) * np.exp(1j * phase)
    np.testing.assert_allclose(walk.final.place, z.real, rtol=0.0, atol=1e-4)


class Same(systems.BouncingBall):
    def guards(self):
        return (Guard("impact", self.gap, reset=lambda y: y),)


class Twice(systems.BouncingBall):
    def guards(self):
        return (Guard("one", self.gap, ends=True), Guard("one", self.gap, ends=True))


class Wide(systems.BouncingBall):
    def guards(self):
        return (Guard("impact", lambda y: jnp.stack([y.height, y.speed]), ends=True),)


class Shapeless(systems.BouncingBall):
    def rates(self, y):
        return (y.speed, 0.0)


class Lost(systems.BouncingBall):
    def rates(self, y):
        return systems.Bounce(y.speed, jnp.nan, 1.0)


START = systems.Bounce(0.1, 0.0, 0.0)


@pytest.mark.parametrize(
    ("system", "options", "words"),
    [
        (Twice(), {}, "two guards 'one'"),
        (Wide(), {}, "has the shape \\(2,\\)"),
        (Shapeless(), {}, "gives a tuple: give a Bounce"),
        (Lost(), {}, "the rate of speed is nan"),
        (BALL, {"save": At("impct")}, "perhaps impact is meant"),
        (BALL, {"save": jb.MidStance()}, "give At"),
        (systems.SpringLegRunner(), {"save": At("fell")}, "the motion ends at that guard"),
        (BALL, {"footsteps": 2}, "footsteps = 2 is not allowed"),
        (BALL, {"watch": ("fall",)}, "watch = 'fall'"),
    ],
)
def test_a_bad_system_gets_a_sentence(system, options, words):
    start = START if system.state_type is systems.Bounce else systems.Running(*[0.5] * 5, 0.0)
    with pytest.raises(jb.ArgumentError, match=words):
        jb.simulate(system, start, duration=1.0, **options)


@pytest.mark.parametrize(
    ("effects", "words"),
    [
        ({"reset": lambda y: y, "ends": True}, "reset and ends"),
        ({"direction": 0, "ends": True}, "direction = 0"),
        ({"direction": 2}, "direction = 2"),
        ({"scale": 0.0}, "scale = 0"),
    ],
)
def test_a_bad_guard_gets_a_sentence(effects, words):
    with pytest.raises(jb.ArgumentError, match=words):
        Guard("impact", lambda y: y.height, **effects)


class Gates(systems.BouncingBall):
    """A ball that falls through several gates at once, each of which ends its motion."""

    def guards(self):
        gates = ("upper", "lower", "last")
        return (Guard("impact", self.gap, reset=lambda y: y), *(
            Guard(name, lambda y: y.height - 0.05, ends=True) for name in gates
        ))  # fmt: skip


def test_of_failures_at_one_instant_every_door_names_the_first():
    system, start = Gates(), systems.Bounce(0.1, 0.0, 1.0)
    assert str(moved(system, start, 1.0, save="end").outcome) == "upper"
    returned = jb.return_map(system, start, section=At("impact"))
    assert int(returned.code) == int(moved(system, start, 1.0, save="end").ending)
    lost = jb.find_gait(system, start, section=At("impact"), parameters=())
    assert str(lost.walk_outcome) == "upper"


def test_resets_that_gather_end_a_motion():
    """A ball that comes to rest, and a reset that leaves the state on its guard."""
    still = dataclasses.replace(BALL, amplitude=0.0)
    e, g = float(still.restitution), float(still.gravity)
    walk = moved(still, START, 3.0, save="end")
    assert str(walk.outcome) == "chatters"
    rest = np.sqrt(2.0 * 0.1 / g) * (1.0 + e) / (1.0 - e)
    np.testing.assert_allclose(walk.t[-1], rest, rtol=1e-5)
    assert str(moved(Same(), START, 3.0, save="end").outcome) == "chatters"
    lost = jb.find_gait(still, START, section=At("phase"), parameters=())
    assert str(lost.outcome) == "no return"
    assert str(lost.walk_outcome) == "chatters"
    assert "ends (chatters); give a state near a gait" in jb.gait.explain_search(still, lost)
