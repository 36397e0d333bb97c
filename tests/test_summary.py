"""Summaries, against the walks, batches and sizes that they tell of."""

import dataclasses
import importlib.metadata

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb


def _walk(ending, steps=5, dtype=jnp.float64):
    ending = jnp.asarray(ending)
    shape = (*ending.shape, steps)
    state = jb.State(*[jnp.zeros(shape, dtype)] * 8)
    counts = jnp.zeros(ending.shape, dtype=jnp.int64)
    return jb.Trajectory(jnp.zeros(shape, dtype), state, ending, counts, counts, None, engine="xla")


def test_a_walk_tells_how_it_ended_and_how_large_it_is():
    # Nine arrays of five numbers, the ending and two counts.
    size = 9 * 5 * 8 + 3 * 8
    said = f"Trajectory(walking, engine=xla, shape=(5,), dtype=float64, {size} B)"
    assert repr(_walk(int(jb.Ending.WALKING))) == str(_walk(0)) == said
    assert "dtype=float32" in repr(_walk(0, dtype=jnp.float32))


def test_a_batch_counts_its_outcomes():
    falls, walks = int(jb.Ending.FELL_FORWARD), int(jb.Ending.WALKING)
    said = repr(_walk([walks, falls, walks]))
    assert said.startswith("Trajectory(2 walking, 1 fell forward, engine=xla, shape=(3, 5)")
    assert repr(_walk(np.zeros(0, dtype=int))).startswith("Trajectory(nothing, ")


def test_what_is_traced_prints_as_well():
    said = []
    jax.jit(lambda code: said.append(repr(_walk(code))))(0)
    assert said[0].startswith("Trajectory(traced, engine=xla, shape=(5,), dtype=float64, ")


@pytest.mark.parametrize(
    ("numbers", "said"),
    [(0, "24 B"), (121, "992 B"), (122, "1 kB"), (185, "1.5 kB"), (312_500_000, "2.5 GB")],
)
def test_memory_in_powers_of_a_thousand(numbers, said):
    """Of so many numbers, and of the ending and two counts beside them."""
    told = []

    def tell(numbers):
        told.append(repr(dataclasses.replace(_walk(0, steps=0), t=numbers)))
        return numbers

    jax.eval_shape(tell, jax.ShapeDtypeStruct((numbers,), jnp.float64))
    assert told[0].endswith(f" {said})")


def test_a_scene_and_its_parts_tell_their_numbers():
    scene = jb.with_parameters(jb.seed_scene(), {"slope": 0.0123456789})
    assert repr(scene.ground) == "Ground(slope=0.0123457, g=9.8)"
    said = repr(scene)
    assert said.startswith(
        "Scene(\n  walker=Walker(m=1, J=0.0096, l=0.4, d=0.1, r=0.08, hip_mass=0)"
    )
    assert "normal=RistowSchafer(K=1e+06, c=1e+07, n=1.5),\n" in said
    assert "ground=Ground(slope=0.0123457, g=9.8)" in said
    assert "actuation" not in said
    batch = jb.with_parameters(scene, {"slope": np.array([0.01, 0.02])})
    assert repr(batch.ground) == "Ground(slope=float64[2], g=9.8)"
    told = []
    jax.jit(lambda held: told.append(repr(held)))(scene.ground)
    assert told == ["Ground(slope=float64[], g=float64[])"]


def test_a_mechanism_tells_its_pieces_as_they_are_written():
    said = repr(jb.seed_scene().mechanism)
    assert said.startswith(
        "Mechanism(\n  root='hip',\n  root_mass=0,\n  bodies=(\n    Body(name='1'"
    )
    assert "Foot(body='2', centre=Point(along=0.32), radius=0.08, name='foot', leg='2')" in said
    assert "mirror=(('1', '2'))" in said
    assert "Structure" not in said
    assert repr(jb.Spring({"a": 1, "b": -1}, stiffness=2.0)) == (
        "Spring(angle=(('a', 1.0), ('b', -1.0)), stiffness=2)"
    )


@pytest.mark.slow
def test_a_gait_tells_its_measures_and_a_lost_one_no_more_than_it_knows():
    scene = jb.ladder()["rigid"]
    gait = jb.find_gait(scene)
    said = repr(gait)
    measures = gait.measures
    assert f"period={float(measures.period):.6g},\n" in said
    assert f"spectral_radius={float(measures.spectral_radius):.6g}" in said
    assert "outcome='found'" in said
    assert "stable=True" in said
    assert repr(measures).startswith("Measures(\n  period=0.44378,")
    assert gait.state is measures.state
    lost = jb.find_gait(jb.with_parameters(scene, {"slope": -0.02}))
    assert "outcome='not converged'" in repr(lost)
    assert "period" not in repr(lost)
    assert "nan" not in repr(lost) + repr(lost.origin) + repr(gait.origin)
    assert "nearest=RigidScene(" in repr(lost.origin)
    assert "nearest" not in repr(gait.origin)
    assert repr(jb.labelling(scene)) == "Labelling(RigidScene, 1 gaits, engine=lanes)"


def test_the_version_is_the_installed_one():
    assert jb.__version__ == importlib.metadata.version("jaxbiped")
