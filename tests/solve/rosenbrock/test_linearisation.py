"""Linearising a vector field, against dense algebra: sizes, structure, answers."""

import dataclasses
from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.dynamics import BristleState
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.solve.rosenbrock._linearisation import (
    ImplicitForm,
    ImplicitLinearisation,
    StepMatrix,
    linearise,
    split,
    structure_of,
)

MASS, BOB, LENGTH, GRAVITY = 2.0, 0.7, 0.9, 9.81


class Crane(NamedTuple):
    """A cart on a spring that carries a pendulum, and a weight that hangs apart from both."""

    x: Any
    angle: Any
    height: Any
    vx: Any
    omega: Any
    vz: Any


def crane(t, y, stiffness):
    """Rates of the crane; the cart is pushed by a force sin(3t)."""
    sine, cosine = jnp.sin(y.angle), jnp.cos(y.angle)
    push = jnp.sin(3.0 * t) - stiffness * y.x - 0.4 * y.vx + BOB * LENGTH * y.omega**2 * sine
    determinant = LENGTH * (MASS + BOB * sine**2)
    cart = (push * LENGTH + BOB * GRAVITY * LENGTH * sine * cosine) / determinant
    pendulum = (-push * cosine - (MASS + BOB) * GRAVITY * sine) / determinant
    weight = -stiffness * y.height - 0.1 * y.vz * jnp.abs(y.vz)
    return Crane(y.vx, y.omega, y.vz, cart, pendulum, weight)


START = Crane(*map(jnp.asarray, (0.1, 0.5, -0.2, 0.3, -1.0, 0.8)))
STIFFNESS = 60.0


def _linearised(field, start, t=0.4):
    components, join = split(start)

    def of_components(t, y):
        return split(field(t, join(y)))[0]

    lin = linearise(of_components, jnp.asarray(t), components)
    dense = jax.jacfwd(lambda y: jnp.stack(of_components(jnp.asarray(t), list(y))))(
        jnp.stack(components)
    )
    return lin, np.asarray(dense)


def _crane():
    return _linearised(lambda t, y: crane(t, y, STIFFNESS), START)


def test_a_jacobian_has_its_entries_where_they_belong():
    lin, dense = _crane()
    mine = lin.jacobian()
    for i in range(6):
        for j in range(6):
            if mine[i][j] is None:
                assert dense[i, j] == 0.0
            else:
                np.testing.assert_allclose(mine[i][j], dense[i, j], rtol=1e-14, atol=1e-14)
    present = np.array([[entry is not None for entry in row] for row in mine])
    free = [2, 5]
    coupled = [0, 1, 3, 4]
    assert not present[np.ix_(free, coupled)].any()
    assert not present[np.ix_(coupled, free)].any()
    assert all(present[i, j] for i, j in [(5, 2), (5, 5), (4, 0)])


def test_a_second_order_system_is_eliminated_at_the_size_of_its_velocities():
    lin, _ = _crane()
    assert lin.direct() == {0: 3, 1: 4, 2: 5}
    inverse = lin.factorise(lin.jacobian(), jnp.asarray(0.01))
    assert [len(row) for row in inverse] == [3, 3, 3]


def test_time_derivative():
    lin, _ = _crane()
    drift = lin.time_derivative()
    assert [entry is None for entry in drift] == [True, True, True, False, False, True]
    sine, cosine = np.sin(START.angle), np.cos(START.angle)
    force = 3.0 * np.cos(1.2) / (LENGTH * (MASS + BOB * sine**2))
    np.testing.assert_allclose([drift[3], drift[4]], [force * LENGTH, -force * cosine], rtol=1e-13)
    still, _ = _linearised(lambda t, y: (y[1], -y[0]), (jnp.asarray(1.0), jnp.asarray(2.0)))
    assert still.time_derivative() == [None, None]


def _solve(lin, jacobian, g, right):
    """All components: the kept ones as the package solves them, the direct ones from those."""
    direct = {p: right[p] for p in lin.direct()}
    matrix = StepMatrix(jacobian, g, lin.factorise(jacobian, g))
    kept = lin.solve_kept(matrix, [right[i] for i in lin.kept()], direct)
    solution = dict(zip(lin.kept(), kept, strict=True))
    solution |= {p: right[p] + g * solution[s] for p, s in lin.direct().items()}
    return [solution[i] for i in range(len(right))]


CHAINS = {
    "second order": lambda t, y: (y[2], y[3], jnp.sin(y[0]) - y[1], y[0] * y[3]),
    "third order": lambda t, y: (y[1], y[2], jnp.cos(y[0]) + y[1], -y[3]),
    "circle": lambda t, y: (y[1], y[0], y[3], y[2]),
    "shared velocity": lambda t, y: (y[3], y[3], y[0] * y[1], y[2] - y[0]),
    "own rate": lambda t, y: (y[0], t + 0.0 * y[1], y[1], t),
    "constant": lambda t, y: (jnp.asarray(1.0), y[0], y[1] * y[2], y[2]),
    "velocities first": lambda t, y: (-y[2] - y[0] * y[3], -jnp.exp(y[3]), y[0], y[1]),
}


@pytest.mark.parametrize("name", [*CHAINS, "crane"])
def test_solutions_equal_those_of_a_dense_matrix(name):
    if name == "crane":
        lin, dense = _crane()
    else:
        lin, dense = _linearised(CHAINS[name], tuple(map(jnp.asarray, (0.3, -0.6, 0.9, 1.3))))
    right = np.random.default_rng(0).normal(size=len(dense))
    jacobian = lin.jacobian()
    for step in (1e-3, 0.3, -0.2):
        mine = _solve(lin, jacobian, jnp.asarray(step), jnp.asarray(right))
        truth = np.linalg.solve(np.eye(len(dense)) - step * dense, right)
        np.testing.assert_allclose(mine, truth, rtol=1e-12, atol=1e-12)


STANDS = jb.seed_state()._replace(hip_z=jnp.asarray(0.3944), omega_1=jnp.asarray(0.7))
SCENES = {
    "seed": jb.seed_scene(slope=0.02),
    "bristles": dataclasses.replace(
        jb.seed_scene(slope=0.02), friction=jb.laws.LuGre.like_seed(jb.seed_scene().friction)
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_the_implicit_form_solves_the_dense_system(name):
    scene = SCENES[name]
    start = STANDS
    if name == "bristles":
        start = BristleState(*STANDS, jnp.asarray(0.1), jnp.asarray(-0.2))
    field = system_of(scene).vector_field
    components, join = split(start, field)

    def rates(t, y):
        return list(field(t, join(y), scene))

    lin = linearise(rates, jnp.zeros(()), components, ImplicitForm(field, join, scene))
    assert isinstance(lin, ImplicitLinearisation)
    dense = jax.jacfwd(lambda y: jnp.stack(rates(0.0, list(y))))(jnp.stack(components))
    right = np.random.default_rng(0).normal(size=len(components))
    jacobian, direct = lin.jacobian(), right[list(lin.direct())]
    for step in (1e-6, 1e-3, -1e-4):
        g = jnp.asarray(step)
        mine = _solve(lin, jacobian, g, jnp.asarray(right))
        whole = np.eye(len(dense)) - step * np.asarray(dense)
        np.testing.assert_allclose(mine, np.linalg.solve(whole, right), rtol=1e-9, atol=1e-10)
        matrix = StepMatrix(jacobian, g, lin.factorise(jacobian, g))
        by_kept, by_direct = lin.solution_matrices(matrix)
        again = by_kept @ right[lin.kept()] + by_direct @ direct
        np.testing.assert_allclose(again, [mine[i] for i in lin.kept()], rtol=1e-9, atol=1e-10)


def test_legs_do_not_touch_each_other_in_the_tree_s_form():
    field, scene = system_of(SCENES["seed"]).vector_field, SCENES["seed"]
    components, join = split(STANDS, field)
    form = ImplicitForm(field, join, scene)
    lin = linearise(lambda t, y: list(field(t, join(y), scene)), jnp.zeros(()), components, form)
    factors = lin.factorise(lin.jacobian(), jnp.asarray(1e-3))
    omega_1, omega_2 = (STANDS._fields.index(f"omega_{leg}") for leg in "12")
    assert (omega_1, omega_2) not in factors.entries
    assert (omega_2, omega_1) not in factors.entries


def test_steps_in_the_implicit_form_are_the_same():
    """Through diffrax backwards, where it wraps the field; forwards go all walks by XLA."""
    scene = SCENES["seed"]

    def end(field):
        return diffrax.diffeqsolve(
            diffrax.ODETerm(field), jb.solvers.Rodas4(), 0.01, 0.0, -1e-4, STANDS, args=scene
        ).ys

    field = system_of(scene).vector_field
    implicit, plain = end(field), end(lambda t, y, args: field(t, y, args))
    np.testing.assert_allclose(np.stack(implicit), np.stack(plain), rtol=1e-9, atol=1e-11)


def _steps(field, start):
    return diffrax.diffeqsolve(
        diffrax.ODETerm(field),
        jb.solvers.Rodas4(),
        0.0,
        0.5,
        0.02,
        start,
        saveat=diffrax.SaveAt(t1=True, ts=[0.013, 0.301]),
        max_steps=64,
    ).ys


@pytest.mark.slow
def test_arrays_and_large_states_step_as_scalars_do():
    """Six scalars, one (2, 3) array beside a scalar, and thirty entries (dense algebra)."""

    def field(t, y, args=None):
        return crane(t, y, STIFFNESS)

    truth = np.stack(_steps(field, START), axis=-1)

    def of_array(t, y, args):
        rates = field(t, Crane(*y["crane"].reshape(-1)))
        return {"crane": jnp.stack(rates).reshape(2, 3), "decay": -y["decay"]}

    start = {"crane": jnp.stack(START).reshape(2, 3), "decay": jnp.asarray(1.0)}
    array = _steps(of_array, start)
    np.testing.assert_allclose(array["crane"].reshape(3, 6), truth, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(array["decay"][-1], np.exp(-0.5), rtol=1e-8)

    copies = Crane(*(jnp.stack([value] * 5) for value in START))
    assert sum(value.size for value in copies) == 30
    large = np.stack(_steps(field, copies), axis=-1)
    assert large.shape == (3, 5, 6)
    np.testing.assert_allclose(large, np.stack([truth] * 5, axis=1), rtol=1e-12, atol=1e-12)


def test_split_and_join():
    y = {"a": jnp.asarray(1.0), "b": jnp.arange(6.0).reshape(2, 3), "none": None}
    components, join = split(y)
    assert [jnp.shape(component) for component in components] == [()] * 7
    assert jax.tree.all(jax.tree.map(jnp.array_equal, join(components), y))
    assert len(split(jnp.zeros(24))[0]) == 24
    (vector,), join = split({"a": jnp.zeros((5, 5)), "b": jnp.ones(())})
    assert vector.shape == (26,)
    assert join([vector])["a"].shape == (5, 5)


# Structure read off a program: no dependence is missed.


def _structure(function, inputs):
    return structure_of(jax.make_jaxpr(function)(*[jnp.asarray(1.5)] * inputs))


def test_dependences_and_copies():
    def function(a, b, c, d):
        return b, a * c, jnp.asarray(2.0), 3.0 * d, a, jnp.sin(b) + d

    depends, copies = _structure(function, 4)
    assert depends == tuple(map(frozenset, [{1}, {0, 2}, set(), {3}, {0}, {1, 3}]))
    assert copies == (1, None, None, None, 0, None)


def test_calls_are_looked_into():
    inner = jax.jit(lambda a, b: (b, a * a))

    @jax.custom_jvp
    def custom(a, b):
        return a * 2.0, b

    custom.defjvp(lambda primals, tangents: (custom(*primals), tangents))

    def function(a, b, c):
        first, second = inner(a, b)
        third, fourth = custom(b, c)
        fifth, sixth = jax.checkpoint(lambda x, y: (y, jnp.cos(x)))(a, c)
        return first, second, third, fourth, fifth, sixth

    depends, copies = _structure(function, 3)
    assert depends == tuple(map(frozenset, [{1}, {0}, {1}, {2}, {2}, {0}]))
    assert copies == (1, None, None, 2, 2, None)


@pytest.mark.parametrize(
    "function",
    [
        lambda a, b, c: jax.lax.cond(a > 0.0, lambda: b, lambda: c),
        lambda a, b, c: jnp.where(a > 0.0, b, c),
        lambda a, b, c: jax.lax.while_loop(lambda x: x < a, lambda x: x + b, c),
        lambda a, b, c: jax.lax.fori_loop(0, 3, lambda _, x: x * a + b, c),
        lambda a, b, c: jax.lax.scan(lambda x, _: (x * a + b, None), c, None, length=2)[0],
        lambda a, b, c: jnp.stack([a, b, c])[1] + 0.0,
    ],
)
def test_what_is_not_understood_depends_on_everything(function):
    depends, copies = _structure(lambda a, b, c: (function(a, b, c), b), 3)
    assert depends == (frozenset({0, 1, 2}), frozenset({1}))
    assert copies == (None, 1)


def test_never_misses_an_entry_of_the_jacobian():
    def function(*x):
        a, b, c, d = x
        e = jnp.where(a > b, a * c, d)
        return e, jnp.hypot(b, d), jnp.floor(c), a - a, jax.jit(jnp.arctan2)(e, b)

    depends, _ = _structure(function, 4)
    x = [jnp.asarray(value) for value in np.random.default_rng(0).normal(size=4)]
    jacobian = jax.jacfwd(lambda x: function(*x))(x)
    for used, row in zip(depends, jacobian, strict=True):
        assert {j for j, entry in enumerate(row) if entry != 0.0} <= used
