"""Endings, against states made by hand on both sides of each threshold."""

import inspect

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from tests.compliant_walkers import held_walker

SEED = jb.seed_scene()
ALWAYS = held_walker()
REACH, RADIUS = 0.32, 0.08
SPEED, RATE = np.sqrt(9.8 * 0.4), np.sqrt(9.8 / 0.4)
Ending = jb.Ending
WATCHES = inspect.signature(jb.simulate).parameters["watch"].default


def happens(state):
    """Every ending at a state, by rules: it is the same wherever on the slope the walker is."""
    here, up, down = (
        _happens(jax.tree.map(np.float64, state._replace(hip_x=x))) for x in (0.0, -5.0, 5.0)
    )
    assert here == up == down
    return here


@jax.jit
def _happens(state):
    """Every ending at a state: on ground that always holds, and under the paper's rule."""
    told = {}
    for rule, scene in (("always", ALWAYS), ("paper", SEED)):
        events = jb.hybrid.Walking().failures(WATCHES).items()
        told[rule] = {str(name): test(0.0, state, scene) for name, test in events}
    return told


def state(**values):
    known = dict.fromkeys(jb.State._fields, 0.0) | values
    return jb.State(**{name: jnp.asarray(float(value)) for name, value in known.items()})


def astride(*, rear, front, speeds, depth=1e-4, **more):
    """Feet at these angles, both this deep; the rear one, leg 1, moves by (slip, indentation)."""
    slip, rate = speeds
    # The hip moves straight down, the front foot along with it: the rear leg's rate makes the rest.
    cosine, sine = np.cos(rear), np.sin(rear)
    omega = slip / (REACH * cosine + RADIUS)
    vz = -rate - REACH * sine * omega
    return state(theta_1=rear, theta_2=front, omega_1=omega, hip_vz=vz,
                 omega_2=0.0, hip_z=RADIUS - depth + REACH * cosine, **more)  # fmt: skip


def swapped(state):
    return jb.dynamics.exchange_legs(jb.seed_scene(), state)


@pytest.mark.parametrize("exchange", [lambda s: s, swapped], ids=["leg 1", "leg 2"])
def test_a_stumble_is_the_rear_foot_coming_down_forwards(exchange):
    slow, fast = 0.5e-3 * SPEED, 2e-3 * SPEED
    cases = [
        ((fast, fast), True),
        ((slow, fast), False),
        ((fast, slow), False),
        ((-fast, fast), False),
        ((fast, -fast), False),
    ]
    for speeds, expected in cases:
        # The front foot is held back, lest it come down as fast.
        made = astride(rear=-0.3, front=0.3, speeds=speeds)
        reach = REACH * np.sin(0.3)
        held = made._replace(omega_2=-(made.hip_vz + 0.0) / reach)
        told = happens(exchange(held))["always"]
        assert bool(told["stumbled"]) is expected, speeds
    # It is the front foot that comes down: a heel strike.
    ahead = astride(rear=0.3, front=-0.3, speeds=(fast, fast))
    held = ahead._replace(omega_2=ahead.hip_vz / (REACH * np.sin(0.3)))
    assert not bool(happens(exchange(held))["always"]["stumbled"])
    off = held._replace(theta_1=held.theta_2, theta_2=held.theta_1, omega_1=held.omega_2,
                        omega_2=held.omega_1, hip_z=held.hip_z + 0.01)  # fmt: skip
    assert not bool(happens(exchange(off))["always"]["stumbled"])


@pytest.mark.parametrize(
    ("above", "vx", "ending"),
    [(-1e-6, 0.1, Ending.FELL_FORWARD), (-1e-6, -0.1, Ending.FELL_BACK), (1e-6, 0.1, None)],
)
def test_a_hip_that_a_leg_at_one_radian_could_not_carry_has_fallen(above, vx, ending):
    low = state(hip_z=RADIUS + REACH * np.cos(1.0) + above, hip_vx=vx, theta_1=1.3, theta_2=-1.3)
    told = happens(low)["paper"]
    for each in (Ending.FELL_FORWARD, Ending.FELL_BACK):
        assert bool(told[str(each)]) is (each is ending)


def test_what_stands_still_has_stopped():
    still = astride(rear=-0.3, front=0.3, speeds=(0.0, 0.0))
    assert bool(happens(still)["always"]["stopped"])
    # ½ (2 kg) v² on both sides of 1e-10 of the weight times l.
    edge = np.sqrt(1e-10 * 2.0 * 9.8 * 0.4)
    for share, expected in ((0.9, True), (1.1, False)):
        moving = still._replace(hip_vx=jnp.asarray(share * edge))
        assert bool(happens(moving)["always"]["stopped"]) is expected
    assert not bool(happens(still._replace(hip_z=still.hip_z + 0.01))["always"]["stopped"])


@pytest.mark.parametrize("exchange", [lambda s: s, swapped], ids=["leg 1", "leg 2"])
def test_a_stance_leg_at_rest_has_stopped_under_the_papers_rule(exchange):
    for rate, expected in ((-0.5e-4, True), (-2e-4, False)):
        stands = state(theta_1=0.05, omega_1=rate * RATE, theta_2=-0.8, omega_2=0.3,
                       hip_z=RADIUS - 1e-4 + REACH * np.cos(0.05))  # fmt: skip
        assert bool(happens(exchange(stands))["paper"]["stopped"]) is expected
    for rate, expected in ((0.05, True), (0.2, False)):
        sinks = state(theta_1=0.05, omega_1=rate * RATE, theta_2=-0.8, omega_2=0.3,
                      hip_z=RADIUS - 1e-4 + REACH * np.cos(0.05))  # fmt: skip
        assert bool(happens(exchange(sinks))["paper"]["stopped"]) is expected


@pytest.mark.parametrize("exchange", [lambda s: s, swapped], ids=["leg 1", "leg 2"])
def test_a_leg_barred_ahead_came_too_late_and_one_behind_too_early(exchange):
    """Leg 1 turns back deep underground, where the ground pushes it forward again at once."""
    stands = np.arccos((REACH * np.cos(0.35) - 5e-3 + 7.3e-4) / REACH)
    for other, rate, ending in ((-stands, -0.01, "fell forward"), (stands, 3.0, "stumbled")):
        deep = state(theta_1=0.35, omega_1=0.5e-4 * RATE, theta_2=other, omega_2=rate,
                     hip_z=RADIUS - 5e-3 + REACH * np.cos(0.35))  # fmt: skip
        told = happens(exchange(deep))["paper"]
        for name in ("fell forward", "stumbled"):
            assert bool(told[name]) is (name == ending), (other, name)
        faster = deep._replace(omega_1=4.0 * deep.omega_1)
        assert not bool(happens(exchange(faster))["paper"][ending])
        higher = deep._replace(hip_z=deep.hip_z + 6e-3)
        assert not bool(happens(exchange(higher))["paper"][ending])
