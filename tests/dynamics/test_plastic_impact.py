"""What is held in impacts and at rest, against an enumeration of all that may be held.

In maximal coordinates.
"""

import itertools

import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped import Mechanism, Stop
from jaxbiped.compiler import host_jit
from jaxbiped.dynamics._mode_changes import settled, with_mode
from jaxbiped.dynamics._stance import stance_on
from jaxbiped.dynamics._stance_motion import Grip, plastic_impact
from jaxbiped.scene._modes import Mode, rigid_modes
from tests.dynamics.test_modes import HEEL_TOE, couples
from tests.dynamics.test_rolling_mechanisms import rigid, sole_of, whole
from tests.mechanisms import SLOPE, G
from tests.random_mechanisms import maximal_accelerations

MIRROR = (("leg_1", "leg_2"), ("foot_1", "foot_2"))
STOPS = (
    *(Stop(f"foot_{i}", upper=3.0) for i in (1, 2)),
    Stop({"leg_1": 1, "leg_2": -1}, upper=3.0, lower=-3.0),
)
PARTS = dict(root_mass=0.3, bodies=HEEL_TOE.bodies, feet=HEEL_TOE.feet, mirror=MIRROR)
WALKER, BARE = Mechanism(**PARTS, joints=STOPS), Mechanism(**PARTS)
SCENE = rigid(WALKER)
TOLERANCE = 1e-9
YES, NO = np.bool_(True), np.bool_(False)


@host_jit()
def struck(scene, state, held, down):
    """Behind an impact of those ends of the foot that are down, with limits that may let go."""
    grip, feet = Grip(held, (True,) * len(held)), WALKER.structure.feet_of_leg[1]
    found = plastic_impact(stance_on(scene, state, 1), feet, down, None, rigid_modes(WALKER), grip)
    motion = found.stance.pose.motion
    return motion.rates, found.impulse, found.stands, found.held


def drawn(seed):
    """A state whose second foot lies flat, and limits that take part."""
    random = np.random.default_rng(seed)
    names = [f"{kind}_{body}" for kind in ("theta", "omega") for body in WALKER.structure.bodies]
    numbers = dict(zip(names, random.uniform(-1.0, 1.0, len(names)), strict=True))
    state = SCENE.state(**numbers | {"theta_foot_2": 0.0})
    held = random.uniform(size=4) < 0.7
    held[3] &= ~held[2]  # both limits of one stop are never reached at once
    return jax.tree.map(np.float64, state), tuple(map(np.bool_, held))


def responses(motion):
    """By contacts, a foot's along the ground and up, and limits: its speed, and what it moves.

    Of rates, or of accelerations.
    """
    limits = rigid_modes(WALKER).limits
    count = 2 + len(motion.rates)
    still = motion._replace(vx=0.0, vz=0.0, rates=(0.0,) * (count - 2))
    free = maximal_accelerations(BARE, still, SLOPE, 0.0)

    def moving(values):
        return still._replace(vx=values[0], vz=values[1], rates=tuple(values[2:]))

    rows, answers = {}, {}
    for foot in (2, 3):
        body, lowest, *_ = sole_of(SCENE, motion, foot)
        speeds = np.array([sole_of(SCENE, moving(e), foot)[3] for e in np.eye(count)])
        for k, force in enumerate(np.eye(2)):
            rows[foot, k] = speeds[:, k]
            given = [(body, lowest, *force)]
            answers[foot, k] = maximal_accelerations(BARE, still, SLOPE, 0.0, given) - free
    for i, limit in enumerate(limits):
        rows[i] = np.array([0.0, 0.0, *(limit.gap.of(e) for e in np.eye(count - 2))])
        given = couples(SCENE, still, [limit], [1.0])
        answers[i] = maximal_accelerations(BARE, still, SLOPE, 0.0, given) - free
    return rows, answers


def brought_to_rest(used, rows, answers, before):
    """What these contacts and limits make of rates, or accelerations; and their impulses."""
    matrix = np.array([[rows[a] @ answers[b] for b in used] for a in used])
    impulses = np.linalg.solve(matrix, -np.array([rows[a] @ before for a in used]))
    return before + sum(p * answers[b] for p, b in zip(impulses, used, strict=True)), impulses


def allowed(motion, held, before):
    """Of all sets of contacts and limits those with no pull and no penetration.

    Each with what becomes of `before`, rates or accelerations.
    """
    rows, answers = responses(motion)
    able = [i for i, each in enumerate(held) if each]
    feet = [(2,), (3,), (2, 3)]
    subsets = [s for n in range(len(able) + 1) for s in itertools.combinations(able, n)]
    found = []
    for stand, stay in itertools.product(feet, subsets):
        presses = [(foot, 1) for foot in stand] + list(stay)
        used = [(stand[0], 0), *presses]
        after, impulses = brought_to_rest(used, rows, answers, before)
        others = {(2, 1), (3, 1), *able} - set(presses)
        leaves = [rows[each] @ after for each in others]
        if min([*impulses[1:], *leaves]) >= -TOLERANCE:
            found.append((stand, stay, after[2:]))
    return found


def test_an_impact_holds_the_one_set_that_neither_pulls_nor_penetrates():
    """Where there is none the walker would have to fly: one end of its foot stays all the same."""
    sets = set()
    for seed in range(150):
        state, held = drawn(seed)
        motion = whole(SCENE, state)
        expected = allowed(motion, held, np.array([motion.vx, motion.vz, *motion.rates]))
        rates, impulse, stands, _ = struck(SCENE, state, held, (YES, YES))
        sets.add(expected[0][0] if expected else ())
        if not expected:
            assert any(stands)
            continue
        for stand, _, after in expected:
            np.testing.assert_allclose(rates, after, atol=1e-8)
            assert tuple(k for k, each in zip((2, 3), stands, strict=True) if each) == stand
        assert float(impulse.z) > -TOLERANCE
    assert sets == {(), (2,), (3,), (2, 3)}


def test_one_end_of_a_foot_comes_to_rest_and_the_other_stays_free():
    for seed, (foot, down) in itertools.product(range(5), ((2, (YES, NO)), (3, (NO, YES)))):
        state, _ = drawn(seed)
        motion = whole(SCENE, state)
        before = np.array([motion.vx, motion.vz, *motion.rates])
        after, impulses = brought_to_rest([(foot, 0), (foot, 1)], *responses(motion), before)
        rates, impulse, stands, _ = struck(SCENE, state, (NO,) * 4, down)
        np.testing.assert_allclose(rates, after[2:], atol=1e-8)
        np.testing.assert_allclose((impulse.x, impulse.z), impulses, atol=1e-8)
        assert tuple(stands) == down


@host_jit()
def rested(scene, state, held):
    """Which feet and limits hold a flat foot and limits that are held, at rest, as they are."""
    modes, yes = rigid_modes(WALKER), state.mode == state.mode
    mode = Mode((yes, yes), held, (~yes,) * len(modes.locks))
    found = modes.decoded(jnp, settled(scene, with_mode(scene, state, mode), 1).mode)
    return found.stands, found.held


def test_forces_hold_the_one_set_that_neither_pulls_nor_penetrates():
    """A stop that pulls is let go before it can lift an end of the flat foot."""
    sets, random = set(), np.random.default_rng(0)
    for seed in range(150):
        state, held = drawn(seed)
        # What is held is at rest, the leg that swings only if a stop holds it.
        leg = 0.0 if held[2] or held[3] else random.uniform(-9.0, 9.0)
        foot = leg if held[0] else random.uniform(-9.0, 9.0)
        rates = dict(omega_leg_1=leg, omega_foot_1=foot, omega_leg_2=0.0, omega_foot_2=0.0)
        state = state._replace(**{name: np.float64(rate) for name, rate in rates.items()})
        motion = whole(SCENE, state)
        expected = allowed(motion, held, maximal_accelerations(BARE, motion, SLOPE, G))
        stands, stay = (np.flatnonzero(each) for each in rested(SCENE, state, held))
        assert [(stand, kept) for stand, kept, _ in expected] == [(tuple(2 + stands), tuple(stay))]
        sets.add((tuple(2 + stands), len(stay)))
    assert {each for each, _ in sets} == {(2,), (3,), (2, 3)}
    assert {count for _, count in sets} >= {0, 1, 2}
