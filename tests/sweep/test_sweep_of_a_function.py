"""Sweeps, stores and starts, against labels that are a plain function of the start."""

import json
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.basins._labels import Label
from jaxbiped.sweep import _nearest_failure, _store
from jaxbiped.sweep._attractor import attractor_without_radius, component_scales
from jaxbiped.sweep._labelling_loop import Labelled
from jaxbiped.sweep._labelling_settings import effort_of
from tests.rigid_walkers import STABLE, simplest_state, simplest_walker
from tests.sweep.walkers import gaitless, stacked, with_attractor

SCENE = simplest_walker(0.009)
LABELLING = gaitless(SCENE, simplest_state(*STABLE))


@pytest.fixture
def by_formula(monkeypatch):
    """Every labelling labels by the sign of a difference of angles; counts the starts it labels."""
    asked = []

    def follow(self, states, given, effort):
        count, column = len(states.hip_x), np.asarray(states.theta_2, float)
        asked.append(count)
        whole = np.zeros(count, int)
        label = np.where(column > 0.2, int(Label.FELL_BACK), int(Label.STUMBLED)).astype(np.int8)
        return Labelled(label, whole - 1, whole, whole, column, 10.0 * column, column, column,
                        whole + 7, np.zeros((count, 4)))  # fmt: skip

    monkeypatch.setattr(jb.Labelling, "_label_once", follow)
    return asked


def grid(low=0.1, high=0.3, count=6, omegas=(-1.2, -1.0), **options):
    axes = {"theta_stance": np.linspace(low, high, count), "omega_stance": omegas}
    return jb.starts.grid(SCENE, axes, **options)


def swept(path, starts, *, labelling=LABELLING, chunk=4):
    return jb.sweep(labelling, starts, store=path, chunk=chunk, look_for_gaits=False)


def test_a_store_keeps_what_was_labelled_and_labels_it_once(tmp_path, by_formula):
    found = swept(tmp_path / "a", grid())
    theta = np.linspace(0.1, 0.3, 6)
    expected = np.repeat(np.where(theta > 0.2, 2, 4)[:, None], 2, axis=1)
    np.testing.assert_array_equal(found.label, expected)
    np.testing.assert_allclose(found.distance, np.repeat(10.0 * theta[:, None], 2, axis=1))
    assert (found.theta_stance.attrs["units"], found.omega_stance.attrs["units"]) == (
        "rad", "rad/s",
    )  # fmt: skip
    assert sum(by_formula) == 12
    again = swept(tmp_path / "a", grid())
    assert sum(by_formula) == 12
    assert (again.attrs["labelled_in_this_run"], again.attrs["chunks_found_complete"]) == (0, 3)
    np.testing.assert_array_equal(again.label, expected)


@pytest.mark.parametrize("field", ["label", "gait", "closest", "attempted"])
@pytest.mark.parametrize("damage", [None, b"garbage"])
def test_a_lost_or_damaged_chunk_is_labelled_anew(tmp_path, by_formula, field, damage):
    whole = swept(tmp_path / "a", grid()).load()
    assert by_formula == [4, 4, 4]
    chunk = tmp_path / "a" / field / "c" / "2" / "0"
    chunk.unlink() if damage is None else chunk.write_bytes(damage)
    with pytest.warns(RuntimeWarning, match="1 of its chunks were lost or damaged"):
        again = swept(tmp_path / "a", grid())
    assert by_formula == [4] * 4
    assert again.load().drop_attrs().identical(whole.drop_attrs())
    swept(tmp_path / "a", grid())
    assert by_formula == [4] * 4


def test_two_clients_begin_one_store(tmp_path, by_formula, monkeypatch):
    """The other one makes the same store while this one writes its own."""
    plain, inner = _store._write_empty, []

    def write(*args):
        if not inner:
            inner.append(1)
            swept(tmp_path / "a", grid())
        plain(*args)

    monkeypatch.setattr(_store, "_write_empty", write)
    found = swept(tmp_path / "a", grid())
    assert (found.label.values >= 0).all()
    assert [each.name for each in tmp_path.iterdir()] == ["a"]
    assert swept(tmp_path / "a", grid()).attrs["labelled_in_this_run"] == 0


def test_a_store_in_the_home_folder(tmp_path, by_formula, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    swept("~/a", grid())
    assert [each.name for each in tmp_path.iterdir()] == ["a"]


def place(scene, states):
    return states


SAMPLE = dict(bounds={"theta_stance": (0.1, 0.3)}, count=8)
OTHERS = {
    "bounds": (grid(), grid(high=0.31)),
    "another axis": (grid(), grid(omegas=(-1.2, -1.1))),
    "placed": (grid(), grid(place=True)),
    "followed": (grid(), grid(follow=place)),
    "sample bounds": (
        jb.starts.sample(SCENE, **SAMPLE),
        jb.starts.sample(SCENE, **SAMPLE | {"bounds": {"theta_stance": (0.1, 0.31)}}),
    ),
    "sample seed": (jb.starts.sample(SCENE, **SAMPLE), jb.starts.sample(SCENE, **SAMPLE, seed=1)),
    "sample method": (
        jb.starts.sample(SCENE, **SAMPLE),
        jb.starts.sample(SCENE, **SAMPLE, method="halton"),
    ),
    "given": tuple(
        jb.starts.GivenStarts(stacked([simplest_state(angle, -0.2)] * 2)) for angle in (0.2, 0.21)
    ),
}


@pytest.mark.parametrize("what", OTHERS)
def test_a_store_goes_on_with_its_own_starts_only(what, tmp_path, by_formula):
    first, other = OTHERS[what]
    swept(tmp_path / "a", first)
    with pytest.raises(jb.ArgumentError, match="was made with other settings: starts"):
        swept(tmp_path / "a", other)


@pytest.mark.parametrize("change", [dict(rtol=1e-5), dict(footsteps=13), dict(solver="rodas5p")])
def test_a_store_goes_on_with_its_own_effort_only(change, tmp_path, by_formula):
    swept(tmp_path / "a", grid())
    other = gaitless(SCENE, simplest_state(*STABLE), **change)
    with pytest.raises(jb.ArgumentError, match="was made with other settings: effort"):
        swept(tmp_path / "a", grid(), labelling=other)
    moved = gaitless(jb.with_parameters(SCENE, {"slope": 0.01}), simplest_state(*STABLE))
    with pytest.raises(jb.ArgumentError, match=r"was made with other settings: scene\.slope"):
        swept(tmp_path / "a", grid(), labelling=moved)


def test_a_chunk_that_was_begun_is_labelled_again(tmp_path, by_formula):
    import zarr

    swept(tmp_path / "a", grid())
    group = zarr.open_group(str(tmp_path / "a"), mode="r+", use_consolidated=False)
    done, label = group["done"], group["label"]
    done[1], label[2:4] = 0, 8
    before = sum(by_formula)
    found = swept(tmp_path / "a", grid())
    assert sum(by_formula) - before == 4
    assert sorted(set(found.label.values.ravel().tolist())) == [2, 4]


def test_samples_lie_within_their_bounds_and_fill_them():
    bounds = {"theta_stance": (0.1, 0.3), "omega_stance": (-2.0, -1.0)}
    batch = jb.starts.sample(SCENE, bounds, 256).batch(LABELLING, 0, 256)
    for name, (low, high) in bounds.items():
        column = batch.columns[name]
        assert low <= column.min() < low + 0.02 * (high - low)
        assert high - 0.02 * (high - low) < column.max() <= high
    np.testing.assert_array_equal(batch.states.theta_2, batch.columns["theta_stance"])
    np.testing.assert_array_equal(batch.states.omega_2, batch.columns["omega_stance"])


UNITS = {"theta": "rad", "omega": "rad/s", "hip_z": "m", "hip_v": "m/s"}


@pytest.mark.parametrize("scene", [SCENE, jb.seed_scene()], ids=["rigid", "compliant"])
def test_coordinates_have_the_units_of_what_they_are(scene):
    for name, quantity in jb.starts.coordinate_quantities(scene).items():
        expected = [unit for begin, unit in UNITS.items() if name.startswith(begin)]
        assert not expected or quantity.unit == expected[0], name


@pytest.mark.parametrize("length", [0.4, 1.6])
def test_components_are_scaled_by_leg_length_and_gravity(length):
    scene = jb.with_parameters(jb.seed_scene(), {"l": length, "d": 0.05})
    state = jb.seed_state()._replace(hip_z=(length - 0.08) * np.cos(0.1655) + 0.08 - 3e-4)
    scales = dict(zip(jb.State._fields[1:], component_scales(scene, state), strict=True))
    speed, rate = np.sqrt(9.8 * length), np.sqrt(9.8 / length)
    assert scales["hip_z"] == pytest.approx(3e-4)
    assert [scales["hip_vx"], scales["hip_vz"]] == pytest.approx([speed, speed])
    assert [scales["omega_1"], scales["omega_2"]] == pytest.approx([rate, rate])
    assert [scales["theta_1"], scales["theta_2"]] == [1.0, 1.0]


def test_a_gait_draws_nearer_in_its_metric_by_its_contraction():
    """|W A e| ≤ q |W e| for every direction of the section."""
    jacobian = np.zeros((6, 4))
    jacobian[:4] = [[0.3, 0.0, 0.9, 0.1], [0.0, 0.3, 0.0, 0.0], [0.0, 0.2, 0.4, 0.3],
                    [0.5, 0.0, 0.0, 0.6]]  # fmt: skip
    jacobian[0] = -jacobian[1]  # onto the section, where the angles are opposite
    radius = np.abs(np.linalg.eigvals(jacobian[:4])).max()
    gait = SimpleNamespace(
        ending=0, stable=True, return_jacobian=jacobian, multipliers=np.zeros(3),
        measures=SimpleNamespace(
            state=jb.dynamics.RigidState(0.0, -0.2, 0.2, -0.1, -0.2), spectral_radius=radius,
            period=3.0, step_length=0.4,
        ),
        cycle_footsteps=1, orbit=(None, [np.zeros((1, 2))] * 5),
    )  # fmt: skip
    found = attractor_without_radius(SCENE, gait)
    q = 0.5 * (1.0 + radius)
    assert found.contraction == pytest.approx(q)
    random = np.random.default_rng(1)
    for _ in range(20):
        e = random.standard_normal(4)
        e[0] = -e[1]
        image = found.metric @ jacobian[:4] @ e
        assert np.linalg.norm(image) <= q * np.linalg.norm(found.metric @ e) * (1.0 + 1e-9)
    assert found.distance(found.point[None]) == 0.0


def test_recurrences_are_looked_for_above_the_tolerance():
    assert [effort_of(SCENE, rtol=rtol).gap for rtol in (1e-9, 1e-4)] == pytest.approx([1e-4, 3e-4])
    effort = effort_of(SCENE, rtol=1e-9)._replace(rtol=1e-3)
    assert effort.gap == pytest.approx(3e-3)


def test_every_label_but_walking_is_a_failure(monkeypatch):
    asked = {}

    def shock(fails, origin, **options):
        asked.update(options, origin=origin, found=fails(np.zeros((5, 4))))

    codes = np.array([int(Label.WALKING), 1, int(Label.STUMBLED), int(Label.UNRESOLVED), 9])
    monkeypatch.setattr(_nearest_failure, "minimal_fatal_shock", shock)
    monkeypatch.setattr(
        jb.Labelling, "__call__", lambda *_, **__: SimpleNamespace(label=codes), raising=True
    )
    knows = with_attractor(LABELLING)
    jb.nearest_failure(knows, gradients=False, max_distance=0.7)
    assert asked["found"].tolist() == [0, 1, 1, 1, 1]
    np.testing.assert_array_equal(asked["origin"], knows.family.rows[0][0].point)
    np.testing.assert_array_equal(asked["scales"], knows.family.scales[0])
    assert (asked["max_distance"], asked["normal"]) == (0.7, None)


def test_starts_of_other_parameters_have_no_gait_to_come_to():
    family = with_attractor(LABELLING).family
    own, cycles = family.goals({}, 2)
    assert (own.radii.tolist(), cycles) == ([[1e-2], [1e-2]], (1,))
    other, _ = family.goals({"slope": np.array([0.01, 0.02])}, 2)
    assert np.isneginf(other.radii).all()


def test_settings_tell_scene_family_and_effort():
    settings = json.loads(json.dumps(with_attractor(LABELLING).settings()))
    (gait,) = settings["gaits"][0]["gaits"]
    assert (gait["cycle_footsteps"], gait["radius"]) == (1, 1e-2)
    assert settings["scene"]["slope"] == pytest.approx(float(jnp.asarray(0.009)))
