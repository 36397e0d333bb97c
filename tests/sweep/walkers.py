"""Starts of sweeps, and labellings that need no gait to be found."""

import contextlib
from typing import ClassVar

import jax.tree_util as jtu
import numpy as np
import zarr

import jaxbiped as jb
from jaxbiped.basins import Label
from jaxbiped.sweep._attractor import component_scales
from jaxbiped.sweep._labelling_preparation import effort_of


def gaitless(scene, state, **options):
    """A labelling that knows no gait; nothing is compiled for it."""
    settings = dict(
        footsteps=12, accuracy="balanced", rtol=None, solver="rodas4", max_solver_steps=65536,
        engine="lanes",
    )  # fmt: skip
    effort = effort_of(scene, **{**settings, **options})
    state = jtu.tree_map(np.asarray, state)
    scales = component_scales(scene, state)[None]
    return jb.labels.Labelling(
        scene, jb.labels.Family((), np.zeros((1, 0)), ((),), (state,), scales), effort
    )


class ByFormula(jb.labels.Labelling):
    """Labels by the sign of a difference of angles, and counts the starts it labels."""

    asked: ClassVar[list[int]] = []

    def __call__(self, states, *, parameters=None):
        count, column = len(states.hip_x), np.asarray(states.theta_2, float)
        self.asked.append(count)
        whole = np.zeros(count, int)
        label = np.where(column > 0.2, int(Label.FELL_BACK), int(Label.STUMBLED)).astype(np.int8)
        return jb.labels.Labelled(
            label, whole - 1, whole, whole, column, 10.0 * column, column, column, whole + 7,
            np.zeros((count, 4)),
        )  # fmt: skip


def as_kind(kind, labelling, *more):
    """The labelling, as one of another class."""
    return kind(labelling.scene, labelling.family, labelling.effort, *more)


def with_attractor(labelling):
    """A labelling told that its own state is a gait's, which draws in whatever comes near."""
    (state,) = labelling.family.states
    size = len(state) - 1
    metric = np.linalg.qr(np.random.default_rng(0).standard_normal((size, size)))[0][:-1]
    point = np.array([[float(leaf) for leaf in state[1:]]])
    multipliers, model = np.full(size - 1, 0.5), 0.5 * np.eye(size - 1)
    gait = jb.labels.Attractor(
        1, 3.88, 0.398, state, multipliers, metric, 0.75, 1e-2, model, metric[:2], point
    )
    family = labelling.family._replace(rows=((gait,),))
    return jb.labels.Labelling(labelling.scene, family, labelling.effort)


def stacked(states):
    """Single states as one with leaves of shape (n,)."""
    columns = zip(*states, strict=True)
    return type(states[0])(*[np.array([float(leaf) for leaf in column]) for column in columns])


def rows(tree, places):
    """Some of the entries of every leaf."""
    return jtu.tree_map(lambda leaf: np.asarray(leaf)[places], tree)


def same(found, expected):
    """Checks that two trees hold the same bits."""
    for a, b in zip(jtu.tree_leaves(found), jtu.tree_leaves(expected), strict=True):
        np.testing.assert_array_equal(np.asarray(a), np.asarray(b))


def same_results(found, expected):
    """Checks that two sweeps' results hold the same bits."""
    assert set(found.data_vars) - {"done"} == set(expected.data_vars) - {"done"}
    for name in expected.data_vars:
        if name != "done":
            np.testing.assert_array_equal(found[name].values, expected[name].values, err_msg=name)


def simplest_grid(scene, count=8):
    """Starts about the simplest walker's gait; some walk, others fall either way."""
    axes = {
        "theta_stance": np.linspace(0.16, 0.24, count),
        "omega_stance": np.linspace(-0.25, -0.17, count),
    }
    return jb.starts.grid(scene, axes)


class Killed(BaseException):
    """As if the process ended there."""


@contextlib.contextmanager
def killed_at(monkeypatch, number=None):
    """Kills what writes into a store at this number of its arrays' writes; counts them if none."""
    write, writes = zarr.Array.__setitem__, []

    def killing(self, *place_and_value):
        writes.append(1)
        if len(writes) == number:
            raise Killed
        write(self, *place_and_value)

    with monkeypatch.context() as patched, contextlib.suppress(Killed):
        patched.setattr(zarr.Array, "__setitem__", killing)
        yield writes
    assert number in (None, len(writes))
