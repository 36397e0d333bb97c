"""Stages of a search, and what is said of them, against ends that are written down."""

from types import SimpleNamespace

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped._progress import Stage
from jaxbiped.gait import BranchEnd, FoundBy, LinearisedReturn, _guess_free_search, _walk_waves
from jaxbiped.gait._fixed_point_search import FixedPointProblem, Found
from jaxbiped.gait._guess_free_search import origin_of, search_in_stages, spectral_radius
from jaxbiped.hybrid._scales import recurring_sizes
from jaxbiped.solve._accuracy import Precision

SCENE = jb.ladder()["rigid"]
START = jb.dynamics.RigidState(0.0, -0.2, 0.3, -1.0, -2.0)


def found(radius, period=0.5, *, advance=0.2, ending=jb.gait.Search.FOUND, sound=True):
    """A gait with a leading pair of this radius."""
    jacobian = np.diag([0.1, 0.0, 0.05, 0.0])
    jacobian[:2, :2] = radius * np.array([[0.6, -0.8], [0.8, 0.6]])
    whole = np.asarray(0)
    last = LinearisedReturn(
        np.full(4, period), jacobian, jacobian, whole, np.asarray(period), whole,
        np.array([advance]), *[whole] * 7, None,
    )  # fmt: skip
    pair = last._replace(**{
        name: np.stack([np.asarray(leaf)] * 2) for name, leaf in last._asdict().items()
        if leaf is not None
    })  # fmt: skip
    return Found(np.asarray(int(ending)), np.asarray(3), last.recurring, np.asarray(0.0), pair,
                 whole, whole, np.asarray(sound))  # fmt: skip


NOTHING = found(9.0, ending=jb.gait.Search.NOT_CONVERGED)


def staged(monkeypatch, first, *, walking=(), branch=None, scattered=(), engine="lanes"):
    """A search whose stages come to these, and which stages it took."""
    took = []
    queue = {"walk": list(walking), "scatter": list(scattered), "branch": []}

    def walks(scene, starts):
        took.append(f"walk {len(starts.hip_x)}")
        points = [np.full(4, 1.0)] * len(queue["walk"])
        return SimpleNamespace(settled=lambda: points, counts=starts.hip_x)

    def follow(*_, begins_at_model):
        took.append("branch")
        end = BranchEnd.FOLD if branch is None else BranchEnd.REACHED
        queue["branch"] = [] if branch is None else [branch]
        return SimpleNamespace(points=[np.full(4, 2.0)], s=np.array([0.5]), end=end, farthest=0,
                               code=0)  # fmt: skip

    def search(problem, patience):
        mark = float(problem.guess.theta_1)
        kind = {1.0: "walk", 2.0: "branch"}.get(mark, "scatter")
        if kind == "scatter" and "scatter" not in took:
            took.append("scatter")
        return queue[kind].pop(0) if queue[kind] else NOTHING

    monkeypatch.setattr(_walk_waves, "walks_from", walks)
    monkeypatch.setattr(_guess_free_search, "branch_along", follow)
    scout = SimpleNamespace(engine=engine)
    spec = SimpleNamespace(steps=1, system=jb.hybrid.Rolling())
    problem = FixedPointProblem(spec, SCENE, (), START, Precision(1e-9, 1e-8))
    now = Stage("searching for a gait", None, "searches", 0)
    return search_in_stages(search, problem, scout, first, now), took


def test_a_stable_gait_ends_the_search_and_an_unstable_one_does_not(monkeypatch):
    told, took = staged(monkeypatch, found(0.5))
    assert (took, told.best.by, told.best.radius) == ([], FoundBy.START, pytest.approx(0.5))
    told, took = staged(monkeypatch, found(1.5), walking=[found(1.2, 0.6), found(0.9, 0.7)])
    assert took == ["walk 1024"]
    assert told.best.by is FoundBy.WALKING
    assert [each.radius for each in told.others] == pytest.approx([1.2, 1.5])


def test_stages_follow_each_other_and_the_least_unstable_gait_is_told(monkeypatch):
    told, took = staged(monkeypatch, NOTHING, branch=found(1.3, 0.6), scattered=[found(1.1, 0.8)])
    assert took == ["walk 1024", "branch", "walk 1024", "scatter"]
    assert (told.best.by, told.best.radius) == (FoundBy.SCATTERED_STARTS, pytest.approx(1.1))
    assert [each.by for each in told.others] == [FoundBy.CONTINUATION]
    _, took = staged(monkeypatch, NOTHING, engine="xla")
    assert took == ["branch", "scatter"]
    nothing = staged(monkeypatch, NOTHING)[0]
    assert (nothing.best, nothing.walks, nothing.searches) == (None, 1024, 12)
    assert staged(monkeypatch, found(0.5))[0].searches == 1


def test_a_gait_that_is_seen_twice_or_is_no_walk_is_told_once_or_not(monkeypatch):
    again = found(1.5, 0.5 * (1.0 + 0.5e-5))
    told, _ = staged(
        monkeypatch, found(1.5), branch=again, scattered=[found(0.5, 0.9, sound=False)]
    )
    assert (told.best.radius, told.others) == (pytest.approx(1.5), ())
    # What a walk itself settles on is one, however deep.
    told, _ = staged(monkeypatch, NOTHING, walking=[found(0.5, sound=False)])
    assert told.best.by is FoundBy.WALKING
    # A foot that chatters where the walker stands is none.
    assert (
        staged(monkeypatch, NOTHING, walking=[found(0.5, 4e-7, advance=1e-8, sound=False)])[0].best
        is None
    )
    problem = FixedPointProblem(None, SCENE, (), START, None)
    origin = origin_of(staged(monkeypatch, found(1.5), scattered=[found(1.2, 0.7)])[0], problem)
    assert float(origin.others.period[0]) == 0.5
    assert float(origin.others.spectral_radius[0]) == pytest.approx(1.5)
    assert np.isnan(origin.others.period[1:]).all()
    assert int(origin.branch_end) == int(BranchEnd.FOLD)


def test_a_jacobian_that_is_no_number_has_no_radius():
    assert spectral_radius(found(0.7)) == pytest.approx(0.7)
    assert spectral_radius(found(np.nan)) == np.inf


def test_walks_are_settled_that_hardly_move_any_more():
    """Of six walks the one that repeats every other footstep, and one that still drifts; the last
    stands, and its foot chatters."""
    sizes = recurring_sizes(SCENE, START)
    rate = np.sqrt(9.8 / 0.4)
    np.testing.assert_allclose(sizes, [1.0, 1.0, rate, rate])
    assert recurring_sizes(jb.seed_scene(), jb.seed_state()).tolist() == pytest.approx(
        [0.4, 1.0, 1.0, np.sqrt(9.8 * 0.4), np.sqrt(9.8 * 0.4), rate, rate]
    )
    last = np.arange(5.0)
    angle = np.stack([0.2 + 0.01 * last, 0.5 + 0.3 * (last % 2), 0.2400001 + 0.0 * last,
                      0.9 + 0.0 * last, 0.7 - 0.1 * last, 0.1 + 0.0 * last])  # fmt: skip
    zero = np.zeros_like(angle)
    places = np.where(np.arange(6)[:, None] < 5, 0.2, 1e-8) * last
    states = jb.dynamics.RigidState(places, angle, zero, zero, zero)
    counts = np.array([40, 40, 40, 39, 40, 40])
    walks = _walk_waves._walks_at(SCENE, counts, states, counts)
    assert walks.attempted == 239
    chosen = walks.settled()
    # The third is where the first one is; the fourth fell.
    assert [float(point[0]) for point in chosen] == pytest.approx([0.5, 0.2400001, 0.3])
    assert len(walks.settled(most=1)) == 1


def gait(
    outcome, *, end=BranchEnd.NOT_FOLLOWED, stable=True, others=(), grazes=0, walk=0, walks=0,
    length=-0.2,
):  # fmt: skip
    nearest = jb.with_parameters(SCENE, {"slope": 0.015})
    return SimpleNamespace(
        sensitivities=SimpleNamespace(period=np.zeros(2)),
        measures=SimpleNamespace(step_length=length),
        outcome=outcome, found_by="walks", others=others, grazes=grazes, stable=stable,
        walk_outcome=jb.Ending.STUMBLED,
        step_lengths=np.zeros(1), cycle_footsteps=1,
        origin=SimpleNamespace(
            branch_end=int(end), nearest=nearest, branch_walk_ending=walk, walks=walks,
            searches=1 + walks // 64,
        ),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (gait(jb.gait.Search.FOUND), "found by walks"),
        (gait(jb.gait.Search.FOUND, grazes=3), "grazes a switch 3 times"),
        (
            gait(jb.gait.Search.FOUND, end=BranchEnd.FOLD, stable=False),
            "no stable one was seen; the branch of the seed's gait turns back at a fold at slope = "
            "0.015",
        ),
        (gait(jb.gait.Search.NO_RETURN), "the walk from the start ends (stumbled)"),
        (gait(jb.gait.Search.NO_WALK), "a foot deep underground"),
        (gait(jb.gait.Search.NO_WALK, length=0.2), "a foot deep underground"),
        (gait(jb.gait.Search.NO_WALK, length=3e-4), "footsteps of 0.0003 m, below 1 % of the"),
        (
            gait(jb.gait.Search.NO_RETURN, walks=1024),
            "(stumbled); 16 further searches and 1024 walks led to none",
        ),
        (gait(jb.gait.Search.NOT_CONVERGED, end=BranchEnd.REACHED), 'try accuracy="tight"'),
        (gait(jb.gait.Search.NOT_CONVERGED, end=BranchEnd.NO_BEGINNING), "has no gait under these"),
        (
            gait(
                jb.gait.Search.NOT_CONVERGED, end=BranchEnd.WALK_ENDS, walk=int(jb.Ending.STOPPED)
            ),
            "ends at slope = 0.015, the nearest scene with a gait: beyond, the walk stops",
        ),
        (gait(jb.gait.Search.NOT_CONVERGED, end=BranchEnd.BREAKS_OFF), "is not smooth"),
    ],
)
def test_a_search_is_explained_in_one_sentence(made, said):
    sentence = jb.gait.explain_search(SCENE, made)
    assert said in sentence
    assert not sentence.endswith(".")


def test_straight_legs_that_scuff_are_told_what_to_try():
    seed = jb.seed_scene()
    parts = dict(walker=seed.walker, ground=seed.ground, normal=seed.normal, friction=seed.friction)
    scuffing = jb.Scene(**parts, clearance=jb.laws.AlwaysTouching())
    gait = jb.find_gait(scuffing, jb.seed_state(), parameters=(), radius_sensitivities=False)
    told = jb.gait.explain_search(scuffing, gait)
    assert "stumbled" in told
    assert told.endswith("give the scene clearance=jaxbiped.laws.StanceRotation()")
    assert "clearance" not in jb.gait.explain_search(seed, gait)
