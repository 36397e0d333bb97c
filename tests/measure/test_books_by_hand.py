"""Measures of walks, against forces, places and powers that are written down."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.dynamics._contacts import Contacts, FootForce
from jaxbiped.dynamics._energy import Energies, Powers
from jaxbiped.dynamics._footfalls import FootMotion
from jaxbiped.measure import _cost_of_transport, _energy_ledger, _footsteps
from jaxbiped.measure._footsteps import HeelStrikes
from jaxbiped.measure._samples import NODES, ModeChanges, Samples
from jaxbiped.solve._trajectory import Trajectory

SCENE = jb.with_parameters(jb.seed_scene(), {"hip_mass": 0.7})
WEIGHT = 2.7 * 9.8


def foot(x, depth):
    blank = np.zeros_like(x)
    return FootMotion(x, blank, blank, blank, depth, blank, blank, None, None)


def test_footsteps_are_measured_by_the_foot_that_strikes_and_the_larger_load(monkeypatch):
    """Three strikes, by feet 2, 1, 2: two footsteps, whose samples lie on two intervals each."""
    time = np.array([1.0, 1.5, 2.25])
    places = {1: np.array([0.0, 0.3, 0.35]), 2: np.array([0.1, 0.15, 0.55])}
    edges = np.array([1.0, 1.2, 1.5, 2.0, 2.25])
    flat = lambda *values: np.repeat(np.array(values, float)[:, None], 5, axis=1)
    loads = {1: flat(10, 0, 40, 30), 2: flat(20, 25, 0, 50)}
    touching = flat(1, 0, 1, 1) > 0, flat(1, 1, 0, 1) > 0
    depths = flat(1e-3, 9e-3, 3e-3, 2e-3), flat(2e-3, 4e-3, 8e-3, 1e-3)
    forces = tuple(FootForce(loads[k], None) for k in (1, 2))
    values = Contacts(tuple(foot(depth, depth) for depth in depths), touching, forces)
    at_strikes = SimpleNamespace(feet=(foot(places[1], time), foot(places[2], time)))
    books = SimpleNamespace(
        damper_loss=np.array([0.5, 0.7]), friction_loss=np.array([0.1, 0.2]),
        residual=np.array([1e-6, -2e-6]),
    )  # fmt: skip
    asked = []

    def change(scene, trajectory, function, condition, before, after):
        asked.append((before.tolist(), after.tolist()))
        return np.array([1.3, 2.25])[: len(before)]

    monkeypatch.setattr(
        _footsteps, "heel_strikes", lambda *_: HeelStrikes(time, np.array([2, 1, 2]))
    )
    monkeypatch.setattr(_footsteps, "evaluate_at", lambda *_: at_strikes)
    monkeypatch.setattr(_footsteps, "sample", lambda *_: Samples(edges, values))
    monkeypatch.setattr(_footsteps, "energy_ledger", lambda *_: books)
    monkeypatch.setattr(_footsteps, "moments_of_change", change)
    found = jb.footsteps(SCENE, None)
    np.testing.assert_allclose(found.time_s, [1.5, 2.25])
    np.testing.assert_allclose(found.period_s, [0.5, 0.75])
    np.testing.assert_allclose(found.length_m, [0.2, 0.25])  # 0.1 → 0.3 → 0.55
    np.testing.assert_allclose(found.speed_m_s, [0.4, 1.0 / 3.0])
    np.testing.assert_allclose(found.peak_normal_N, [25.0, 50.0])
    np.testing.assert_allclose(found.max_penetration_m, [4e-3, 3e-3])
    np.testing.assert_allclose(
        found.cost_of_transport, [0.6 / (WEIGHT * 0.2), 0.9 / (WEIGHT * 0.25)]
    )
    np.testing.assert_allclose(found.energy_residual_J, books.residual)
    # Both feet carry from the first strike until after 1.2 s; at the second strike one does not.
    assert asked == [([1.0], [1.5])]
    np.testing.assert_allclose(found.double_support_s, [0.3, 0.0], atol=1e-12)


def flows(monkeypatch, module, edges, powers):
    """Constant powers on each interval."""
    flat = lambda values: (
        None if values is None else np.repeat(np.array(values)[:, None], 5, axis=1)
    )
    motors = powers.pop("motors", None)
    known = Powers(**{name: flat(values) for name, values in powers.items()})
    known = known._replace(motors=None if motors is None else tuple(map(flat, motors)))
    monkeypatch.setattr(module, "sample", lambda *_: Samples(np.asarray(edges), known))


def test_a_ledger_closes_over_what_it_is_made_of(monkeypatch):
    """Over [0, 1] and [1, 3]: kinetic, gravitational and elastic energy, and constant powers."""
    held = Energies(
        np.array([1.0, 3.0, 2.0]), np.array([9.0, 5.0, 4.0]), np.array([0.0, 0.5, 0.25])
    )
    monkeypatch.setattr(_energy_ledger, "evaluate_at", lambda *_: held)
    zero = [0.0, 0.0, 0.0]
    flows(monkeypatch, _energy_ledger, [0.0, 1.0, 2.0, 3.0], dict(
        gravity=zero, indentation=[2.0, 1.0, 0.5], damper=zero, friction=[0.25, 0.0, 0.75],
        actuation=[1.0, 0.0, -0.5],
    ))  # fmt: skip
    monkeypatch.setattr(_energy_ledger, "check_scene_of", lambda *_: None)
    walk = SimpleNamespace(require_dense=lambda: None)
    books = jb.energy_ledger(SCENE, walk, np.array([0.0, 1.0, 3.0]))
    np.testing.assert_allclose(books.gravity_work, [4.0, 1.0])
    np.testing.assert_allclose(books.damper_loss, [2.0 - 0.5, 1.5 + 0.25])
    np.testing.assert_allclose(books.friction_loss, [0.25, 0.75])
    np.testing.assert_allclose(books.stored_change, [2.5, -1.25])
    np.testing.assert_allclose(books.actuation_work, [1.0, -0.5])
    np.testing.assert_allclose(books.residual, [4.0 + 1.0 - 1.5 - 0.25 - 2.5, 0.5 - 2.5 + 1.25])


STATES = jb.State(*[np.zeros(3)] * 8)


def test_the_cost_of_a_driven_walk_counts_driving_motors_and_gravity(monkeypatch):
    spring = jb.actuation.HipSpring(1.0)
    scene = dataclasses.replace(SCENE, actuation=spring)
    told = {"energies": SimpleNamespace(gravitational=np.array([5.0, 4.0, 4.5]))}
    place = np.array([0.0, 0.2, 0.6])

    def evaluate(scene, walk, function, times):
        return told.get(function.__name__, place)

    monkeypatch.setattr(_cost_of_transport, "evaluate_at", evaluate)
    flows(monkeypatch, _cost_of_transport, [0.0, 1.0, 2.0, 3.0], dict(
        gravity=[0.0] * 3, indentation=[0.0] * 3, damper=[0.0] * 3, friction=[0.0] * 3,
        motors=[[3.0, -2.0, 1.0], [-1.0, 0.5, 0.25]],
    ))  # fmt: skip
    whole = np.zeros(())
    walk = Trajectory(np.arange(3.0), STATES, whole, whole, whole)
    found = jb.measure.cost_of_transport(scene, walk, np.array([0.0, 1.0, 3.0]))
    np.testing.assert_allclose(found.motor_work, [3.0, 1.0 + 0.75])
    np.testing.assert_allclose(found.gravity_work, [1.0, -0.5])
    np.testing.assert_allclose(found.distance, [0.2, 0.4])
    np.testing.assert_allclose(found.cost, [4.0 / (WEIGHT * 0.2), 1.25 / (WEIGHT * 0.4)])


def test_the_cost_of_a_rigid_walk_is_between_the_places_where_it_stands(monkeypatch):
    scene = jb.RigidScene(SCENE.walker, SCENE.ground)
    states = jb.dynamics.RigidState(
        np.array([0.0, 0.2]), np.zeros(2), np.array([0.3, 0.1]), np.zeros(2), np.zeros(2)
    )
    books = SimpleNamespace(gravity_work=np.array([0.4]), motor_work=np.array([0.1]))
    monkeypatch.setattr(_cost_of_transport, "kept_strikes", lambda *_: (None, states))
    monkeypatch.setattr(_cost_of_transport, "rigid_ledger", lambda *_: books)
    found = jb.measure.cost_of_transport(scene, None)
    way = 0.2 + 0.32 * (np.sin(0.1) - np.sin(0.3))
    np.testing.assert_allclose(found.distance, [way])
    np.testing.assert_allclose(found.cost, [0.5 / (WEIGHT * way)])


def test_a_rigid_ledger_closes_with_its_push_off(monkeypatch):
    """Energies after a strike, before the next and after it; push, hip and joints."""
    scene = jb.RigidScene(SCENE.walker, SCENE.ground)
    states = jb.dynamics.RigidState(*[np.arange(2.0)] * 5)
    energies = (1.0, 9.0, 0.25), (3.0, 6.5, 0.5), (1.5, 6.5, 0.5)
    held = iter([Energies(*[np.array([part]) for part in each]) for each in energies])
    works = _energy_ledger._Works(*[np.array([part]) for part in (-0.5, 0.125, 0.0625)])
    monkeypatch.setattr(_energy_ledger, "kept_strikes", lambda *_: (np.array([1.0, 2.0]), states))
    monkeypatch.setattr(_energy_ledger, "_before_impact", lambda *_: states)
    monkeypatch.setattr(_energy_ledger, "_held", lambda *_: next(held))
    monkeypatch.setattr(_energy_ledger, "push_off_work", lambda *_: np.array([0.25]))
    monkeypatch.setattr(_energy_ledger, "mode_changes", lambda *_: None)
    monkeypatch.setattr(_energy_ledger, "_works", lambda *_: works)
    monkeypatch.setattr(_energy_ledger, "_stop_losses", lambda *_: np.array([0.03125]))
    books = jb.measure.rigid_ledger(scene, None)
    assert [float(part[0]) for part in books] == pytest.approx(
        # gravity; hip and push; lost; stored; left open; motors; joints; stops
        [2.5, -0.25, 1.75, 0.75, 2.5 - 0.25 - 1.75 - 0.75 - 0.09375, 0.375, 0.0625, 0.03125]
    )


def test_what_a_change_of_mode_takes_is_the_energy_beside_it(monkeypatch):
    """Energies that fall steadily but where a mode changes, once in one footstep, twice in another.

    What joints lose on the way is no loss of the change's; NaN where a change was left out.
    """
    scene = jb.RigidScene(SCENE.walker, SCENE.ground)
    changes = np.array([0, 2, 2]), np.array([0.25, 0.5, 0.75])
    taken = np.array([2.0, 0.5, 0.125])

    def held(_, states):
        number, time = states
        gone = [
            sum(taken[(changes[0] == k) & (changes[1] < t)])
            for k, t in zip(number, time, strict=True)
        ]
        return Energies(5.0 - 0.5 * time, 1.0 - 0.25 * time, -np.array(gone))

    monkeypatch.setattr(_energy_ledger, "_held", held)
    monkeypatch.setattr(_energy_ledger, "rows_of", lambda starts, number: number)
    monkeypatch.setattr(_energy_ledger, "states_after", lambda _, rows, times: (rows, times))
    known = np.array([True, True, True, False])
    found = _energy_ledger._stop_losses(scene, None, np.ones(4), ModeChanges(*changes, known))
    np.testing.assert_allclose(found, [2.0, 0.0, 0.625, np.nan], atol=1e-12)


def test_samples_lie_at_gauss_points_and_integrate_what_is_above_zero():
    edges = np.array([0.0, 0.5, 2.0])
    times = 0.5 * (edges[1:] + edges[:-1])[:, None] + 0.5 * np.diff(edges)[:, None] * NODES
    samples = Samples(edges, None)
    np.testing.assert_allclose(samples.integral(times**9), np.diff(edges**10) / 10)
    np.testing.assert_allclose(samples.positive_integral(times - 1.0), [0.0, 0.5])
    np.testing.assert_allclose(samples.positive_integral(1.0 - times), [0.375, 0.125])
