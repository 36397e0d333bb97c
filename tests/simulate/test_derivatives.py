"""Derivatives of simulations, against central differences at tight, in every mode."""

import dataclasses
from functools import partial

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from tests.compliant_walkers import held_walker
from tests.mechanisms import WALKERS, scene_of, seed_walker, start_of

pytestmark = pytest.mark.slow

LEAVES = {
    "K": lambda scene: scene.normal.K,
    "c": lambda scene: scene.normal.c,
    "slope": lambda scene: scene.ground.slope,
    "l": lambda scene: scene.walker.l,
}


def _central(function, at, h):
    """Central difference of a function of a number, or of whatever this step is added to."""
    ends = [np.asarray(function(at + sign * h)) for sign in (1.0, -1.0)]
    return (ends[0] - ends[1]) / (2.0 * h)


def _final(logs, omega=0.0, *, duration=0.8, **options):
    """The final state as a function of the logarithms of some parameters and of a leg's rate."""
    scene = jb.seed_scene()
    for name, log in logs.items():
        value = LEAVES[name](scene) * jnp.exp(log)
        scene = eqx.tree_at(LEAVES[name], scene, value)
    seed = jb.seed_state()
    state = seed._replace(omega_1=seed.omega_1 + omega)
    options = {"accuracy": "tight", "engine": "lanes", "save": "end", **options}
    return jnp.stack(jb.simulate(scene, state, duration=duration, **options).final)


ZEROS = {name: jnp.asarray(0.0) for name in LEAVES}


def test_forward_mode_against_central_differences():
    by_log = jax.jacfwd(_final)(ZEROS)
    # Tighter by far: their errors are divided by the step.
    exact = dict(rtol=1e-12, atol=1e-14)
    for name in LEAVES:
        difference = _central(lambda log, n=name: _final({n: log}, **exact), jnp.zeros(()), 3e-5)
        scale = np.max(np.abs(difference))
        np.testing.assert_allclose(by_log[name], difference, atol=1e-4 * scale)


def test_derivatives_by_the_start_against_central_differences():
    by_start = lambda omega: _final({}, omega)
    by_rate, difference = (
        jax.jacfwd(by_start)(jnp.zeros(())),
        _central(by_start, jnp.zeros(()), 1e-6),
    )
    np.testing.assert_allclose(by_rate, difference, atol=1e-3 * np.max(np.abs(difference)))


def test_reverse_mode_is_forward_modes_transpose():
    forward = jax.jacfwd(_final)(ZEROS)
    reverse = jax.jacrev(_final)(ZEROS)
    for name in LEAVES:
        np.testing.assert_allclose(reverse[name], forward[name], rtol=1e-12)


def test_a_looser_solve_has_derivatives_within_its_own_tolerance():
    tight, loose = (
        jax.jacfwd(lambda log, a=accuracy: _final({"K": log}, accuracy=a))(jnp.asarray(0.0))
        for accuracy in ("tight", "balanced")
    )
    np.testing.assert_allclose(loose, tight, atol=1e-3 * float(jnp.max(jnp.abs(tight))))


def test_derivative_by_the_duration_is_the_rate():
    last, by_time = jax.jvp(
        lambda time: _final({}, duration=time), (jnp.asarray(0.8),), (jnp.asarray(1.0),)
    )
    rates = jb.dynamics.vector_field(0.0, jb.State(*last), jb.seed_scene())
    np.testing.assert_allclose(by_time, jnp.stack(rates), rtol=1e-12)


@pytest.mark.parametrize("compiled", [lambda f: f, jax.jit], ids=["plain", "jit"])
def test_each_saved_time_moves_at_the_rate_of_its_own_state(compiled):
    saved = compiled(
        lambda d: jb.simulate(STEEP, START, duration=9.0, save=jnp.array([0.1, 0.9, 8.0]) + d).state
    )
    states, by_time = jax.jvp(saved, (jnp.asarray(0.05),), (jnp.asarray(1.0),))
    rates = jax.vmap(lambda y: jb.dynamics.vector_field(0.0, y, STEEP))(states)
    np.testing.assert_allclose(jnp.stack(by_time)[:, :2], jnp.stack(rates)[:, :2], rtol=1e-9)
    np.testing.assert_array_equal(jnp.stack(by_time)[:, 2], 0.0)  # it has fallen by then


def test_gradients_under_vmap_and_jit():
    def gradient(log):
        return jax.grad(lambda log: _final({"K": log}, accuracy="balanced")[0])(log)

    logs = jnp.linspace(0.0, 0.1, 3)
    together = jax.jit(jax.vmap(gradient))(logs)
    np.testing.assert_allclose(together, [gradient(log) for log in logs], rtol=1e-12)


RATE = float(jb.seed_state().omega_1)
STEEP = jb.seed_scene(slope=0.06)
SEED, START, TIMES = jb.seed_scene(), jb.seed_state(), jnp.array([0.2, 0.9])
STOPS = START._replace(omega_2=-1.3137, theta_1=-0.4124, hip_vx=0.3559)
TRIPS = START._replace(omega_2=-0.8266, theta_1=-0.2752, hip_vx=0.1941)
ENDS = {
    "duration": (SEED, START, RATE, dict(duration=0.9)),
    "footsteps": (SEED, START, RATE, dict(footsteps=2)),
    "fell forward": (STEEP, START, RATE, dict(duration=9.0, save=jb.HeelStrike())),
    "stopped": (SEED, STOPS, 0.5139, dict(duration=9.0)),
    "stumbled": (held_walker(), TRIPS, -1.7282, dict(duration=9.0)),
    "arrivals": (SEED, START, RATE, dict(duration=0.9, save=jb.HeelStrike())),
    "times": (SEED, START, RATE, dict(duration=0.9, save=TIMES)),
}


def _moments(name, rate, accuracy="balanced"):
    """When and where a simulation arrived, if asked, and ended, by the rate of the swing leg."""
    scene, start, _, how = ENDS[name]
    state = start._replace(omega_1=rate)
    walk = jb.simulate(scene, state, accuracy=accuracy, **({"save": "end"} | how))
    moments, arrivals = [(walk.t, walk.state)], walk.arrivals
    if arrivals is not None:
        count = 2 if name == "arrivals" else 1  # before it fell
        first = jax.tree.map(lambda leaf: leaf[:count], (arrivals.t, arrivals.state))
        moments.insert(0, first)
    rows = [jnp.stack([t, y.hip_x, y.theta_1, y.omega_1]).ravel() for t, y in moments]
    return jnp.concatenate(rows)


@pytest.mark.parametrize("name", ENDS)
def test_derivatives_follow_what_ends_or_saves_a_simulation(name):
    rate, walk = jnp.asarray(ENDS[name][2]), partial(_moments, name)
    right = _central(partial(walk, accuracy="tight"), rate, 1e-5)
    forward, reverse = jax.jacfwd(walk)(rate), jax.jacrev(walk)(rate)
    # The fall's ω is known to 1e-4 at "balanced", a little more or less by the processor.
    share = 2e-4 if name == "fell forward" else 1e-4
    np.testing.assert_allclose(forward, right, atol=share * np.max(np.abs(right)))
    np.testing.assert_allclose(reverse, forward, rtol=1e-12)
    if name not in ("duration", "times"):
        assert abs(float(right[0])) > 1e-3


@pytest.mark.parametrize("how", [dict(footsteps=3), dict(duration=1.1, max_arrivals=3)])
def test_derivatives_of_a_rigid_walk(how):
    scene, start = jb.ladder()["rigid"], jb.dynamics.rigid_state(jb.seed_state())

    def walk(slope, accuracy="balanced"):
        moved = jb.with_parameters(scene, {"slope": slope})
        found = jb.rigid_walk(moved, start, accuracy=accuracy, **how)
        arrivals = [*found.arrivals.t[:2], *found.arrivals.state.omega_1[:2]]
        return jnp.stack(
            [*found.t, *found.final[:4], *arrivals[: 4 * bool(how.get("max_arrivals"))]]
        )

    slope = jnp.asarray(0.02)
    right = _central(partial(walk, accuracy="tight"), slope, 1e-5)
    forward, reverse = jax.jit(jax.jacfwd(walk))(slope), jax.jacrev(walk)(slope)
    np.testing.assert_allclose(forward, right, atol=1e-5 * np.max(np.abs(right)))
    np.testing.assert_allclose(reverse, forward, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "draft"),
    [
        pytest.param("kelvin-voigt", (5e-4, 3e-3), marks=pytest.mark.nightly),
        ("tsuji", (2e-4, 3e-4)),
    ],
)
def test_laws_that_jump_or_are_infinitely_steep_at_touchdown(name, draft):
    """Medians and largest errors over starts, for single ones vary tenfold with where steps fall.

    A long step leaves an error in the stiff mode of the foot that stands. It changes the rates at
    the touchdown, and so all derivatives behind, if little time is left for it to fade.
    Of 17 starts within 2 % of the seed's, Kelvin and Voigt's law has 1.1e-4 and 2.0e-3 at draft,
    1.2e-5 and 2.6e-4 at balanced, 3.5e-7 and 1.0e-6 at tight; Tsuji's 1.5e-4 and 2.3e-4, 1.7e-5 and
    2.6e-4, 2.2e-7 and 3.4e-7.
    """
    law = jb.laws.normal_law_like(name, K=1e6, c=1e7, n=1.5, mass=2.0)
    scene = eqx.tree_at(lambda scene: scene.normal, jb.seed_scene(), law)

    def end(rate, **how):
        state = jb.seed_state()._replace(omega_2=rate)
        walk = jb.simulate(scene, state, duration=0.6, save="end", **how)
        return jnp.stack([walk.final.hip_x, walk.final.theta_1, walk.final.omega_1])

    rates = jb.seed_state().omega_2 * (1.0 + jnp.linspace(-0.02, 0.02, 9))
    right = _central(jax.vmap(partial(end, rtol=1e-12)), rates, 1e-4)
    bounds = {"draft": draft, "balanced": (5e-5, 5e-4), "tight": (1e-6, 2e-6)}
    for accuracy, (median, largest) in bounds.items():
        told = jax.vmap(jax.jacfwd(partial(end, accuracy=accuracy)))(rates)
        errors = np.max(np.abs(told - right), axis=1) / np.max(np.abs(right), axis=1)
        assert np.median(errors) < median, accuracy
        assert np.max(errors) < largest, accuracy


def test_derivatives_at_a_touchdown_are_those_before_the_force_jumps():
    """Of a walker with a heavier leg on Kelvin and Voigt's ground, against a much finer solve."""
    law = dict(K=SEED.normal.K, c=SEED.normal.c, n=SEED.normal.n)
    of_mass = dict(mass=SEED.walker.total_mass, g=SEED.ground.g)
    slips = {name: getattr(SEED.friction, name) for name in ("mu_static", "mu_kinetic", "v0", "xi")}
    scene = dataclasses.replace(
        SEED,
        walker=seed_walker(first=1.02),
        normal=jb.laws.normal_law_like("kelvin-voigt", **law, **of_mass),
        friction=jb.laws.friction_law_like("stribeck", **slips),
    )
    start = scene.state(theta_1=0.1, omega_1=2.3, omega_2=-0.69, standing="2")
    start = start._replace(hip_z=start.hip_z - 1e-6)

    def final(mu, rtol):
        moved = jb.with_parameters(scene, {"mu_kinetic": mu})
        return jnp.stack(jb.simulate(moved, start, footsteps=2, save="end", rtol=rtol).final)

    # Nanoseconds behind the touchdown, some are fifty times as large.
    mu = scene.friction.mu_kinetic
    right = np.asarray(jax.jacfwd(final)(mu, 1e-10))
    for rtol in (1e-6, 7e-7, 5e-7):
        told = np.asarray(jax.jacfwd(final)(mu, rtol))
        np.testing.assert_allclose(told, right, atol=2e-2 * np.max(np.abs(right)))


@pytest.mark.parametrize(
    "numbers",
    [
        dict(slope=0.0077, K=4e7, c=1.3e6, mu_static=0.05, mu_kinetic=0.05, v0=2e-6, xi=7.5),
        dict(slope=0.032, K=8e7, c=2.8e7, mu_static=5.0, mu_kinetic=1.0, v0=1.6e-6, xi=440.0),
        dict(slope=0.089, K=4e7, c=1.5e7, mu_static=1.0, mu_kinetic=1.0, v0=6.4e-6, xi=7e4),
    ],
    ids=["little friction", "peak five times as high", "no peak"],
)
def test_steep_friction_on_stiff_ground(numbers):
    """With respect to relative changes of the slope, the stiffness and the build-up speed."""
    names = ("slope", "K", "v0")
    scene, values = jb.seed_scene(**numbers), jnp.array([numbers[name] for name in names])

    def end(shares, **how):
        moved = jb.with_parameters(scene, dict(zip(names, values * shares, strict=True)))
        walk = jb.simulate(moved, START, footsteps=1, save="end", **how)
        return jnp.concatenate([walk.t, *map(jnp.atleast_1d, walk.final)])

    # Of order four, so that steps can be long: short ones enlarge the walks' own errors.
    steps = jnp.concatenate([k * 1e-3 * jnp.eye(3) for k in (1.0, -1.0, 2.0, -2.0)])
    near, back, far, farther = jax.vmap(partial(end, rtol=3e-13))(1.0 + steps).reshape(4, 3, -1)
    right = (8.0 * (near - back) - (far - farther)).T / 12e-3
    for accuracy, error in (("balanced", 1e-3), ("tight", 3e-6)):
        told = jax.jacfwd(partial(end, accuracy=accuracy))(jnp.ones(3))
        np.testing.assert_allclose(told, right, atol=error * np.max(np.abs(right)))


def _kneed_with_everything():
    """Knees with stops and latches, and a hip whose motor knows who stands."""
    kneed = WALKERS["kneed"].arguments()
    latches = (jb.Latch(f"shank_{i}", at=-0.2, width=0.05, torque=0.02) for i in (1, 2))
    hip = {"thigh_1": 1, "thigh_2": -1}
    motor = jb.Motor(hip, jb.actuation.PD(kp=0.3, kd=0.02, of=hip))
    return jb.Mechanism(**kneed | {"joints": (*kneed["joints"], *latches, motor)})


MOVED = ("shank.stop.K", "shank.latch.torque", "thigh.motor.kp", "slope")


def test_derivatives_of_a_mechanism_follow_what_ends_it():
    """With respect to a part of each kind and to the ground's slope, at once and in both modes."""
    scene = scene_of("kneed", walker=_kneed_with_everything())
    values = jb.parameter_values(scene)
    at = np.array([float(values[name]) for name in MOVED])

    def walk(values, accuracy="balanced"):
        moved = jb.with_parameters(scene, dict(zip(MOVED, values, strict=True)))
        # Its knees are bent: at the stop's limit the start would graze it.
        start = start_of("kneed", scene)._replace(theta_shank_2=0.06)
        found = jb.simulate(moved, start, footsteps=1, save="end", accuracy=accuracy)
        return jnp.concatenate([found.t, *found.state])

    steps = np.diag(1e-5 * np.abs(at))
    ends = jax.vmap(partial(walk, accuracy="tight"))(jnp.asarray(at + np.vstack([steps, -steps])))
    right = (ends[: len(at)] - ends[len(at) :]) / (2e-5 * np.abs(at)[:, None])
    forward, reverse = (each(walk)(jnp.asarray(at)) for each in (jax.jacfwd, jax.jacrev))
    assert abs(float(right[-1, 0])) > 1e-4
    for one, other in zip(forward.T, right, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-3 * np.max(np.abs(other)))
    np.testing.assert_allclose(reverse, forward, rtol=1e-12)


@pytest.mark.nightly
def test_derivatives_do_not_depend_on_the_engine():
    scene = jb.seed_scene()

    def end(slope, engine):
        moved = jb.with_parameters(scene, {"slope": slope})
        how = dict(save=jnp.array([0.05, 0.1]), accuracy="draft", engine=engine)
        return jb.simulate(moved, jb.seed_state(), duration=0.1, **how).state.omega_1

    lanes, xla = (jax.jacfwd(lambda a, e=e: end(a, e))(jnp.asarray(0.02)) for e in ("lanes", "xla"))
    np.testing.assert_allclose(xla, lanes, rtol=1e-12)


def test_a_lane_that_is_not_allowed_has_no_derivative():
    """By itself it is refused by name."""

    def end(mass):
        scene = jb.with_parameters(SEED, {"m": mass})
        return jb.simulate(scene, START, duration=0.02, save="end").final.hip_z

    values, slopes = jax.vmap(jax.value_and_grad(end))(jnp.array([1.0, -1.0]))
    assert np.isnan(values).tolist() == np.isnan(slopes).tolist() == [False, True]
    with pytest.raises(jb.ArgumentError, match=r"^m = -1 is not allowed"):
        jax.grad(end)(-1.0)


@pytest.mark.parametrize(
    ("differentiate", "how", "said"),
    [
        (jax.grad, dict(save="steps", engine="xla"), 'save = "steps" is not allowed under deriv'),
        (jax.grad, dict(extremes=lambda scene, y: y.hip_z), "extremes is not allowed under deriv"),
        (jax.hessian, {}, "Second derivatives of a simulation are not offered"),
    ],
)
def test_what_has_no_derivatives_says_so(differentiate, how, said, monkeypatch, tmp_path):
    """Before anything is compiled, which would be kept: no other test asks for as many steps."""
    monkeypatch.setenv("JAXBIPED_CACHE", str(tmp_path))
    how = {"save": "end", "max_solver_steps": 4097} | how

    def end(rate):
        state = jb.seed_state()._replace(omega_1=rate)
        walk = jb.simulate(jb.seed_scene(), state, duration=0.05, **how)
        return walk.final.theta_1

    with pytest.raises(jb.ArgumentError, match=said):
        differentiate(end)(jnp.asarray(RATE))
    assert not list(tmp_path.rglob("*"))


def test_the_adjoint_of_steps_warns():
    def end(rate):
        state = jb.seed_state()._replace(omega_1=rate)
        how = dict(solver="euler", dt=1e-4, watch=(), save="end")
        return jb.simulate(
            jb.seed_scene(d=0.1), state, duration=2e-4, adjoint=diffrax.ForwardMode(), **how
        ).final.theta_1

    with pytest.warns(RuntimeWarning, match="differentiates the steps that were taken"):
        jax.jvp(end, (jnp.asarray(RATE),), (jnp.asarray(1.0),))
