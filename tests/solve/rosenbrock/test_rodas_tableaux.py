"""The four tableaus, against order conditions, stability and measured orders."""

import operator
from fractions import Fraction

import diffrax
import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.solve.rosenbrock._tableau_form import direct_weights, end_weights, error_weights

SOLVERS = [jb.solvers.Rodas3P, jb.solvers.Rodas4, jb.solvers.Rodas4P, jb.solvers.Rodas5P]
DENSE_ORDER = dict(zip(SOLVERS, (3, 3, 3, 4), strict=True))
STIFF_ORDER = dict(zip(SOLVERS, (3, 2, 4, 4), strict=True))
STEPS = dict(zip(SOLVERS, ((16, 32, 64), (48, 96, 192), (48, 96, 192), (32, 64, 128)), strict=True))
"""Of which the orders of convergence are measured."""
each_solver = pytest.mark.parametrize("solver", SOLVERS, ids=lambda solver: solver.__name__)


class Classic:
    """A tableau with its products by J restored: stages k_i with α, Γ and weights b."""

    def __init__(self, tableau):
        self.tableau = tableau
        size = len(tableau.alpha)
        a, c = np.zeros((size, size)), np.zeros((size, size))
        for i in range(1, size):
            a[i, :i], c[i, :i] = tableau.a[i - 1], tableau.c[i - 1]
        # Longer numbers: rounding of the transformation is not the tableau's error.
        self.gamma = _inverse(np.eye(size) / np.longdouble(tableau.gamma) - c).astype(float)
        self.alpha = a @ self.gamma
        self.beta = self.alpha + self.gamma
        self.end = np.append(a[-1, :-1], 1.0)
        self.b = self.end @ self.gamma

    def embedded(self):
        error = self.tableau.error or np.eye(len(self.end))[-1]
        return (self.end - np.asarray(error)) @ self.gamma

    def dense(self, theta):
        inner = np.zeros_like(self.end)
        for power, row in enumerate(self.tableau.dense):
            inner[: len(row)] += theta**power * np.asarray(row)
        return theta * (self.end + (1.0 - theta) * inner) @ self.gamma

    def stability(self, weights, z):
        identity, ones = np.eye(len(weights)), np.ones(len(weights))
        return 1.0 + weights @ np.linalg.solve(identity / z - self.beta, ones)

    def elementary(self, tree):
        """Weights of a rooted tree (the tuple of its branches) at the stages."""
        if len(tree) == 1:
            return self.beta @ self.elementary(tree[0])
        product = np.ones(len(self.b))
        for branch in tree:
            product = product * (self.alpha @ self.elementary(branch))
        return product


def _inverse(lower):
    """Of a lower triangular matrix, in its own precision."""
    inverse = np.zeros_like(lower)
    for i, row in enumerate(np.eye(len(lower), dtype=lower.dtype)):
        inverse[i] = (row - lower[i, :i] @ inverse[:i]) / lower[i, i]
    return inverse


def _forests(nodes, largest):
    if nodes == 0:
        yield ()
    for size in range(min(nodes, largest), 0, -1):
        for tree in _trees(size):
            for rest in _forests(nodes - size, size):
                yield tuple(sorted((tree, *rest)))


def _trees(nodes):
    return set(_forests(nodes - 1, nodes - 1))


def _nodes(tree):
    return 1 + sum(_nodes(branch) for branch in tree)


def _density(tree):
    return _nodes(tree) * np.prod([_density(branch) for branch in tree])


def _worst(method, weights, order, theta=1.0):
    """Largest violation of the conditions of one order: Σ b_i Φ_i(tree) = θ^order / density."""
    return max(
        abs(weights @ method.elementary(tree) - theta**order / _density(tree))
        for tree in _trees(order)
    )


def test_the_trees_are_all_there():
    assert [len(_trees(nodes)) for nodes in range(1, 7)] == [1, 1, 2, 4, 9, 20]
    assert sorted(_density(tree) for tree in _trees(4)) == [4, 8, 12, 24]


@each_solver
def test_order_conditions(solver):
    """Hairer and Wanner, section IV.7, theorem 7.3 and table 7.1, for any order."""
    method, order = Classic(solver.tableau), solver().order(None)
    for p in range(1, order + 1):
        assert _worst(method, method.b, p) < 1e-14
    assert _worst(method, method.b, order + 1) > 1e-3
    for p in range(1, order):
        assert _worst(method, method.embedded(), p) < 1e-14
    assert _worst(method, method.embedded(), order) > 1e-3


@each_solver
def test_order_conditions_of_the_dense_output(solver):
    method, order = Classic(solver.tableau), DENSE_ORDER[solver]
    for theta in (0.1, 0.35, 0.6, 0.9):
        for p in range(1, order + 1):
            assert _worst(method, method.dense(theta), p, theta) < 5e-14
        assert _worst(method, method.dense(theta), order + 1, theta) > 1e-7


@each_solver
def test_times_match_the_stages(solver):
    """Σ_j α_ij = α_i and Σ_j γ_ij = γ_i make time behave as one more component."""
    method = Classic(solver.tableau)
    np.testing.assert_allclose(method.alpha.sum(1), solver.tableau.alpha, atol=1e-14)
    np.testing.assert_allclose(method.gamma.sum(1), solver.tableau.gammas, atol=1e-14)


@each_solver
def test_weights_of_direct_components_are_the_nearest_floats(solver):
    """Against the stages of such a component one by one, in exact fractions.

    Inverted by LAPACK and multiplied by BLAS, they are off by up to 6.5e-14, and otherwise on each
    kind of processor.
    """
    tableau = solver.tableau
    size, gamma = len(tableau.alpha), Fraction(tableau.gamma)
    stages = [[Fraction(1)] + [Fraction(int(i == j)) for j in range(size)] for i in range(size)]
    for i in range(1, size):
        for j, (a, c) in enumerate(zip(tableau.a[i - 1], tableau.c[i - 1], strict=True)):
            stages[i][1 + j] += Fraction(a)
            memory = [gamma * Fraction(c) * part for part in stages[j]]
            stages[i] = [x + y for x, y in zip(stages[i], memory, strict=True)]
    units = [(*[0.0] * i, 1.0) for i in range(size)]
    for row in (*units, *tableau.a, *tableau.dense, end_weights(tableau), error_weights(tableau)):
        columns = zip(*stages[: len(row)], strict=True)
        right = [float(sum(map(operator.mul, map(Fraction, row), each))) for each in columns]
        assert list(direct_weights(tableau, row)) == right[: 1 + len(row)]


@each_solver
def test_stiffly_accurate_and_l_stable(solver):
    method = Classic(solver.tableau)
    np.testing.assert_allclose(method.beta[-1], method.b, atol=1e-14)
    for weights in (method.b, method.embedded()):
        assert abs(method.stability(weights, -1e14)) < 1e-12
    imaginary = [abs(method.stability(method.b, 1j * y)) for y in np.logspace(-2, 6, 200)]
    assert max(imaginary) < 1.0 + 1e-13


@each_solver
@pytest.mark.parametrize("z", [-1.0, -30.0, -1e4])
def test_polynomials_that_a_stiff_driven_component_follows(solver, z):
    """One step of y' = z (y − t^q) + q t^(q−1) over [0, 1] is exact up to q = stiff order − 1."""
    method, tableau = Classic(solver.tableau), solver.tableau
    alpha, gammas = np.asarray(tableau.alpha), np.asarray(tableau.gammas)

    def error(q):
        driving = -z * alpha**q + q * alpha ** (q - 1)
        time_derivative = {1: -z, 2: 2.0}.get(q, 0.0)
        matrix = np.eye(len(alpha)) - z * method.beta
        return abs(method.b @ np.linalg.solve(matrix, driving + gammas * time_derivative) - 1.0)

    exact_to = STIFF_ORDER[solver] - 1
    assert max(error(q) for q in range(1, exact_to + 1)) < 1e-13
    assert error(exact_to + 1) > 1e-11


BETWEEN = jnp.linspace(0.003, 0.997, 150)


@eqx.filter_jit
def _solve(field, solver, y0, args, steps):
    """Values between steps and, last, at the end of `steps` equal steps over [0, 1]."""
    term, dt0 = diffrax.ODETerm(field), 1.0 / steps
    how = dict(saveat=diffrax.SaveAt(ts=BETWEEN, t1=True), max_steps=512)
    return diffrax.diffeqsolve(term, solver, 0.0, 1.0, dt0, y0, args, **how).ys


def _kaps(t, y, mu):
    """Kaps' stiff problem, run by a clock s(t) = t + sin(2t)/2 so that time matters."""
    rate = 1.0 + jnp.cos(2.0 * t)
    first, second = y
    return rate * (mu * second**2 - (mu + 2.0) * first), rate * (first - second - second**2)


def _kaps_solution(t):
    s = t + 0.5 * np.sin(2.0 * t)
    return np.exp(-2.0 * s), np.exp(-s)


def _prothero_robinson(t, y, stiffness):
    return -stiffness * (y - jnp.sin(t + 0.3)) + jnp.cos(t + 0.3)


def _slope(steps, errors):
    return -np.polyfit(np.log(steps), np.log(errors), 1)[0]


@each_solver
def test_orders_of_convergence(solver):
    steps = STEPS[solver]
    ends, dense = [], []
    truth = _kaps_solution(np.append(np.asarray(BETWEEN), 1.0))
    start = tuple(map(jnp.asarray, _kaps_solution(0.0)))
    for number in steps:
        values = _solve(_kaps, solver(), start, jnp.asarray(4.0), jnp.asarray(float(number)))
        errors = np.max([np.abs(a - b) for a, b in zip(values, truth, strict=True)], axis=0)
        ends.append(errors[-1])
        dense.append(errors[:-1].max())
    order = solver().order(None)
    assert order - 0.3 < _slope(steps, ends) < order + 0.5
    assert _slope(steps, dense) > order - 0.3
    assert ends[0] < 1e-4


@each_solver
def test_orders_on_prothero_robinson_problems(solver):
    """The worst error over all stiffnesses falls with the stiff order."""
    steps, stiffnesses = (8, 16, 32), 10.0 ** np.arange(0.0, 6.1, 0.5)
    errors = np.zeros((3, stiffnesses.size))
    dense = np.zeros(3)
    for i, number in enumerate(steps):
        for j, stiffness in enumerate(stiffnesses):
            start, *numbers = map(jnp.asarray, (np.sin(0.3), stiffness, float(number)))
            values = _solve(_prothero_robinson, solver(), start, *numbers)
            error = np.abs(values - np.sin(np.append(np.asarray(BETWEEN), 1.0) + 0.3))
            errors[i, j] = error[-1]
        dense[i] = error[:-1].max()
    order = STIFF_ORDER[solver]
    assert order - 0.3 < _slope(steps, errors.max(axis=1)) < order + 0.5
    assert _slope(steps, dense) > DENSE_ORDER[solver] - 0.3
    # As stiffness λ grows the error is O(h^(order − 1) / λ).
    np.testing.assert_allclose(errors[0, -1] / errors[0, -3], 0.1, rtol=0.05)
    assert _slope(steps, errors[:, -1]) > order - 1.3
    assert errors[:, -1].max() < 1e-8


@each_solver
def test_fast_decay_is_gone_in_one_step(solver):
    """The distance to the slow solution after one step of h λ = 1e12, from a distance of 1."""
    start, stiffness = 1.0 + jnp.sin(jnp.asarray(0.3)), jnp.asarray(1e12)
    values = _solve(_prothero_robinson, solver(), start, stiffness, jnp.asarray(1.0))
    assert abs(values[-1] - np.sin(1.3)) < 1e-8


@each_solver
def test_one_step_of_linear_decay(solver):
    """The new value and its error estimate are those of the stability functions."""
    method, z = Classic(solver.tableau), -0.8
    term = diffrax.ODETerm(lambda t, y, args: z * y)
    start = jnp.asarray(1.0)
    end, error, dense, _, _ = solver().step(term, 0.0, 1.0, start, None, None, False)
    values = [method.stability(weights, z) for weights in (method.b, method.embedded())]
    np.testing.assert_allclose(end, values[0], rtol=1e-13)
    np.testing.assert_allclose(error, values[0] - values[1], rtol=1e-9)
    middle = solver().interpolation_cls(t0=0.0, t1=1.0, **dense).evaluate(0.3)
    np.testing.assert_allclose(middle, method.stability(method.dense(0.3), z), rtol=1e-12)
