"""Walks on flat rigid feet, against equations and contact conditions written a second time."""

import jax
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jaxbiped as jb

SLOPE, G = 0.05, 9.81
HIP, LEG, FOOT = 8.0, (2.0, 0.05, 0.4), (0.3, 3e-3, (0.02, 0.03))
ANKLE, HEEL, TOE = 0.9, (0.06, -0.06), (0.06, 0.14)
STIFFNESS, DAMPING = 8.0, 0.3
START = dict(
    theta_leg_1=-0.25, theta_foot_1=-0.05, theta_leg_2=0.25, omega_leg_1=0.2, omega_leg_2=-1.0
)


def scene():
    (leg_mass, leg_inertia, leg_centre), (mass, inertia, centre) = LEG, FOOT
    of_leg = dict(mass=leg_mass, inertia=leg_inertia, centre=leg_centre)
    of_foot = dict(mass=mass, inertia=inertia, centre=centre, at=ANKLE)
    legs = [jb.Body(f"leg_{i}", **of_leg) for i in (1, 2)]
    feet = [jb.Body(f"foot_{i}", parent=f"leg_{i}", **of_foot) for i in (1, 2)]
    soles = [
        jb.Foot(f"foot_{i}", centre=place, name=name)
        for i in (1, 2)
        for place, name in ((HEEL, "heel"), (TOE, "toe"))
    ]
    springs = [
        jb.Spring({f"foot_{i}": 1, f"leg_{i}": -1}, stiffness=STIFFNESS, damping=DAMPING)
        for i in (1, 2)
    ]
    walker = jb.Mechanism(
        root_mass=HIP,
        bodies=(*legs, *feet),
        feet=tuple(soles),
        joints=tuple(springs),
        mirror=(("leg_1", "leg_2"), ("foot_1", "foot_2")),
    )
    return jb.RigidScene(walker, jb.Ground(slope=SLOPE, g=G))


def point(q, rates, links):
    """Place of a chain's end, its velocity by the rates, and its acceleration without theirs.

    Coordinates are the hip's place, then the angles of both legs and of both feet.
    """
    place, moves, left = q[:2].copy(), np.zeros((2, 6)), np.zeros(2)
    moves[0, 0] = moves[1, 1] = 1.0
    for body, (along, ahead) in links:
        sine, cosine = np.sin(q[2 + body]), np.cos(q[2 + body])
        turned = np.array([along * cosine - ahead * sine, along * sine + ahead * cosine])
        offset = np.array([turned[1], -turned[0]])
        place += offset
        moves[:, 2 + body] += turned
        left -= offset * rates[2 + body] ** 2
    return place, moves, left


def sole(leg, where):
    return [(leg, (ANKLE, 0.0)), (2 + leg, where)]


def bodies():
    yield HIP, 0.0, None, []
    for leg in (0, 1):
        yield LEG[0], LEG[1], leg, [(leg, (LEG[2], 0.0))]
        yield FOOT[0], FOOT[1], 2 + leg, sole(leg, FOOT[2])


def mass_and_load(q, rates):
    mass, load = np.zeros((6, 6)), np.zeros(6)
    for m, inertia, body, links in bodies():
        _, moves, left = point(q, rates, links)
        mass += m * moves.T @ moves
        load += m * moves.T @ (G * np.array([np.sin(SLOPE), -np.cos(SLOPE)]) - left)
        if body is not None:
            mass[2 + body, 2 + body] += inertia
    for leg in (0, 1):
        bent, bends = (each[4 + leg] - each[2 + leg] for each in (q, rates))
        torque = -STIFFNESS * bent - DAMPING * bends
        load[4 + leg] += torque
        load[2 + leg] -= torque
    return mass, load


def contacts(q, rates, leg, stands):
    """Rows of what stands, along and up each, but along once; accelerations without the rates'."""
    rows, left = [], []
    for where in stands:
        _, moves, own = point(q, rates, sole(leg, where))
        chosen = [1] if rows else [0, 1]
        rows += [moves[i] for i in chosen]
        left += [own[i] for i in chosen]
    return np.array(rows), np.array(left)


def held(mass, load, rows, target):
    """What moves so that the rows come to a target, and the forces that make it."""
    n, k = 6, len(rows)
    matrix = np.block([[mass, -rows.T], [rows, np.zeros((k, k))]])
    found = np.linalg.solve(matrix, np.concatenate([load, target]))
    return found[:n], found[n:]


def forces(y, leg, stands):
    q, rates = y[:6], y[6:]
    rows, left = contacts(q, rates, leg, stands)
    return held(*mass_and_load(q, rates), rows, -left)


def landed(y, leg, stands):
    """Behind the plastic impact of the one set of these that neither pulls nor penetrates."""
    q, rates = y[:6], y[6:]
    mass, _ = mass_and_load(q, rates)
    found = []
    for chosen in {(where,) for where in stands} | {stands}:
        rows, _ = contacts(q, rates, leg, chosen)
        after, impulses = held(mass, mass @ rates, rows, np.zeros(len(rows)))
        leaves = [contacts(q, rates, leg, [w])[0][1] @ after for w in set(stands) - set(chosen)]
        if min([*impulses[1:], *leaves]) >= -1e-12:
            found.append((np.concatenate([q, after]), chosen))
    (only,) = found
    return only


def height(y, leg, where):
    return point(y[:6], y[6:], sole(leg, where))[0][1]


def phase(y, t, leg, stands):
    """Until the other leg's foot comes down, or this one's other end does, or one end lifts."""
    events = [lambda _, y, w=w: height(y, 1 - leg, w) for w in (HEEL, TOE)]
    if len(stands) == 1:
        (other,) = {HEEL, TOE} - set(stands)
        events.append(lambda _, y: height(y, leg, other))
    else:
        events += [lambda _, y, i=i: forces(y, leg, stands)[1][1 + i] for i in (0, 1)]
    for event in events:
        event.terminal, event.direction = True, -1.0

    def rates(_, y):
        return np.concatenate([y[6:], forces(y, leg, stands)[0]])

    how = dict(method="DOP853", rtol=1e-11, atol=1e-12)
    while True:
        found = solve_ivp(rates, (t, t + 3.0), y, events=events, **how)
        t, y = found.t[-1], found.y[:, -1]
        which = next(i for i, times in enumerate(found.t_events) if times.size)
        new, old = (point(y[:6], y[6:], sole(k, HEEL))[0][0] for k in (1 - leg, leg))
        if which >= 2 or new > old:
            return y, t, which
        # It scuffs, and passes through.
        y, t = solve_ivp(rates, (t, t + 1e-6), y, **how).y[:, -1], t + 1e-6


def walk(y, footsteps):
    """Times of heel strikes, and the state behind the last one."""
    leg, stands, t, strikes = 1, (HEEL, TOE), 0.0, []
    while len(strikes) < footsteps:
        y, t, which = phase(y, t, leg, stands)
        if which < 2:
            leg = 1 - leg
            y, stands = landed(y, leg, ((HEEL, TOE)[which],))
            strikes.append(t)
        elif len(stands) == 1:
            y, stands = landed(y, leg, (HEEL, TOE))
        else:
            stands = ((TOE, HEEL)[which - 2],)
    return strikes, y


SEED, LOCKED = jb.seed_scene(), jb.models.hsu_chen()
OF_SEED = dict(theta_1=-0.24, theta_2=0.24, omega_1=-1.09, omega_2=-1.64)
OF_LOCKED = jb.models.MODELS["hsu-chen"].starts["gait"]


@pytest.mark.parametrize(
    ("walker", "start"),
    [
        (jb.RigidScene(SEED.walker, SEED.ground), OF_SEED),
        (LOCKED, OF_LOCKED),
        (scene(), START),
    ],
)
@pytest.mark.parametrize("times", [1.0, 8.0])
def test_a_walk_that_the_ground_would_have_to_hold_down_is_told(walker, start, times):
    """Its leg turns so fast that a real foot would fly."""
    fast = {name: value * times if "omega" in name else value for name, value in start.items()}
    walk = jb.simulate(walker, walker.state(**fast), duration=1e-3)
    flies = jb.dynamics.rigid_checks(walker, walk.final).flies
    assert bool(flies.all()) is (times > 1.0)
    assert int(walk.pulls) == (int(walk.accepted) if times > 1.0 else 0)


NAMES, KINDS = ("leg_1", "leg_2", "foot_1", "foot_2"), ("theta", "omega")


def by_hand(state):
    """A state whose stance foot's heel is at the origin, at rest."""
    kinds = ([float(getattr(state, f"{kind}_{name}")) for name in NAMES] for kind in KINDS)
    y = np.concatenate([[0.0, 0.0], next(kinds), [0.0, 0.0], next(kinds)])
    heel = point(y[:6], y[6:], sole(1, HEEL))
    y[:2] -= heel[0]
    y[6:8] -= heel[1] @ y[6:]
    return y


def agrees(state, found, footsteps):
    """Whether a walk's heel strikes, its end and the hip's way are those by hand."""
    y = by_hand(state)
    strikes, end = walk(y, footsteps)
    np.testing.assert_allclose(np.asarray(found.arrivals.t)[:footsteps], strikes, atol=1e-8)
    ours = [float(getattr(found.final, f"{kind}_{name}")) for kind in KINDS for name in NAMES]
    if footsteps % 2:  # the leg that came down is called the second one
        end = end[[0, 1, 3, 2, 5, 4, 6, 7, 9, 8, 11, 10]]
    np.testing.assert_allclose(ours, [*end[2:6], *end[8:]], atol=1e-7)
    moved = float(found.final.hip_x) - float(state.hip_x)
    assert moved == pytest.approx(end[0] - y[0], abs=1e-7)


@pytest.mark.slow
def test_a_walk_whose_heel_lifts_is_that_of_equations_by_hand():
    """It goes on about the toe, and the hip on its way."""
    walker = scene()
    state = walker.state(**START | dict(omega_leg_1=2.5, omega_leg_2=-1.5))
    found = jb.simulate(walker, state, footsteps=1, accuracy="tight", save=jb.HeelStrike())
    assert found.modes[:2] == (("foot_2.heel", "foot_2.toe"), ("foot_2.toe",))
    agrees(state, found, 1)


@pytest.mark.slow
def test_heel_strikes_and_toe_strikes_are_those_of_equations_by_hand():
    walker = scene()
    state = walker.state(**START)
    found = jb.simulate(walker, state, footsteps=2, accuracy="tight", save=jb.HeelStrike())
    agrees(state, found, 2)
    # What the ankles' dampers lose jumps where the toe comes down.
    books = jb.measure.rigid_ledger(walker, found)
    np.testing.assert_allclose(books.residual / books.joint_loss, 0.0, atol=1e-6)

    def lasts(rate):
        start = state._replace(omega_leg_1=rate)
        return jb.simulate(walker, start, footsteps=2, accuracy="tight").t[-1]

    h = 1e-5
    difference = (float(lasts(0.2 + h)) - float(lasts(0.2 - h))) / (2.0 * h)
    assert float(jax.jacfwd(lasts)(0.2)) == pytest.approx(difference, rel=1e-5)


FORWARD = dict(theta_leg_1=-0.25, theta_leg_2=0.25, omega_leg_1=-0.3, omega_leg_2=-1.6)


def legs_on(ankle, *, bodies=(), joints=(), mass=1.0, inertia=0.0096, centre=0.1, feet=None):
    """Two legs of 0.38 m to the ankle, and what is fixed there."""
    legs = [jb.Body(f"leg_{i}", mass=mass, inertia=inertia, centre=centre) for i in (1, 2)]
    pairs = [("leg_1", "leg_2"), ("foot_1", "foot_2")]
    walker = jb.Mechanism(
        root_mass=0.5,
        bodies=(*legs, *bodies),
        feet=feet or [jb.Foot(f"leg_{i}", centre=ankle) for i in (1, 2)],
        joints=joints,
        mirror=pairs if bodies else pairs[:1],
    )
    return jb.RigidScene(walker, jb.Ground(slope=0.02))


def on_points():
    """Legs that end in points at the ankles, and carry the mass of a foot there."""
    centre = (1.0 * 0.1 + 0.05 * 0.38) / 1.05
    inertia = 0.0096 + (centre - 0.1) ** 2 + 0.05 * (0.38 - centre) ** 2
    return legs_on(0.38, mass=1.05, inertia=inertia, centre=centre)


def on_level_feet(direction, rest=None, stop=None):
    """The same legs on feet that couplings keep from turning: each moves as its ankle does."""
    bodies = [
        jb.Body(f"foot_{i}", mass=0.05, inertia=2e-5, centre=0.01, parent=f"leg_{i}", at=0.38)
        for i in (1, 2)
    ]
    soles = [
        jb.Foot(f"foot_{i}", centre=(0.02, ahead), name=name)
        for i in (1, 2)
        for name, ahead in (("heel", -0.03), ("toe", 0.03))
    ]
    angles = [{f"foot_{i}": 1, direction: -1} for i in (1, 2)]
    joints = [jb.Coupling(angle, rest=rest) for angle in angles]
    joints += [] if stop is None else [jb.Stop(angle, upper=stop) for angle in angles]
    return legs_on(0.38, bodies=bodies, joints=joints, feet=soles)


LEVEL = {
    "normal": (on_level_feet("normal"), 3),
    "vertical": (on_level_feet("vertical"), 1),
    "toes up": (on_level_feet("normal", rest=0.1), 1),
    "toes down": (on_level_feet("normal", rest=-0.1), 2),
    "at a stop": (on_level_feet("normal", stop=0.0), 15),
}
"""Scenes, and the mode that tells which ends of the foot stand."""


@pytest.mark.parametrize("name", LEVEL)
def test_a_foot_that_couplings_keep_level_moves_and_strikes_as_its_ankle(name):
    scene, mode = LEVEL[name]
    state, plain = scene.state(**FORWARD), on_points().state(**FORWARD)
    assert float(state.mode) == mode
    moved = jb.dynamics.rolling_field(0.0, state, scene)
    np.testing.assert_allclose(moved[:-1], jb.dynamics.rolling_field(0.0, plain, on_points()))
    strikes = dict(theta_leg_1=0.25, theta_leg_2=-0.25, omega_leg_1=-1.0, omega_leg_2=-1.6)
    struck, as_point = (
        jb.dynamics.impact(each, each.state(**strikes)) for each in (scene, on_points())
    )
    np.testing.assert_allclose(struck.state[:-1], as_point.state, atol=1e-15)
    np.testing.assert_allclose(struck[1:], as_point[1:])
    assert float(struck.state.mode) == mode


@pytest.mark.slow
def test_a_walk_on_level_feet_is_that_of_its_ankles():
    ends = [
        jb.simulate(scene, scene.state(**FORWARD), footsteps=3)
        for scene in (on_points(), LEVEL["normal"][0])
    ]
    plain, walk = ends
    assert [str(each.outcome) for each in ends] == ["walking", "walking"]
    np.testing.assert_allclose([walk.t[-1], *walk.final[:-1]], [plain.t[-1], *plain.final])
    assert int(walk.pulls) == 0


@pytest.mark.nightly
def test_multipliers_of_a_gait_on_level_feet_are_as_many_under_jit():
    """Those of its ankles, and zero for the mode."""
    how = dict(parameters=(), radius_sensitivities=False)
    plain, scene = on_points(), LEVEL["normal"][0]
    expected = jb.find_gait(plain, plain.state(**FORWARD), **how).multipliers
    gait = jb.find_gait(scene, scene.state(**FORWARD), **how)
    traced = jax.jit(lambda y: jb.find_gait(scene, y, **how))(gait.measures.state)
    for found in (gait, traced):
        np.testing.assert_allclose(found.multipliers, [*expected, 0.0], atol=1e-8)
    shapes = [[np.shape(leaf) for leaf in jax.tree.leaves(each)] for each in (gait, traced)]
    assert shapes[0] == shapes[1]
