"""The compass walker's cheapest step by collocation, from equations of its own.

Legs of 5 kg with their mass at the middle, 10 kg at the hip, length 1 m, level ground: a torque u
turns the swing leg, −u the stance leg, and ∫u² over a step is least. States at Legendre–Gauss–
Lobatto points and parameters of the law are unknowns of one problem.
"""

import jax
import jax.numpy as jnp
import numpy as np

HIP, LEG, LENGTH, CENTRE, GRAVITY = 10.0, 5.0, 1.0, 0.5, 9.81


def points(floating):
    """Places of the hip and of both legs' masses, from the hip's place and the legs' angles."""
    x, z, stance, swing = floating
    hip = jnp.array([x, z])
    down = [jnp.array([jnp.sin(angle), -jnp.cos(angle)]) for angle in (stance, swing)]
    return [(HIP, hip), *((LEG, hip + CENTRE * along) for along in down)]


def mass_matrix(place_of, q):
    """The mass matrix of point masses at these coordinates."""
    total = 0.0
    for k, (mass, _) in enumerate(place_of(q)):
        jacobian = jax.jacfwd(lambda q, k=k: place_of(q)[k][1])(q)
        total = total + mass * jacobian.T @ jacobian
    return total


def standing(q):
    """Places where the stance foot, 1 m down its leg, is at the origin."""
    return points(jnp.array([-LENGTH * jnp.sin(q[0]), LENGTH * jnp.cos(q[0]), q[0], q[1]]))


def accelerations(q, rates, torque):
    """Angular accelerations of stance and swing leg."""

    def kinetic(q, rates):
        return 0.5 * rates @ mass_matrix(standing, q) @ rates

    def height(q):
        return sum(mass * GRAVITY * place[1] for mass, place in standing(q))

    momentum = jax.grad(kinetic, argnums=1)
    bias = jax.jvp(lambda q: momentum(q, rates), (q,), (rates,))[1] - jax.grad(kinetic)(q, rates)
    forces = jnp.array([-torque, torque]) - jax.grad(height)(q) - bias
    return jnp.linalg.solve(mass_matrix(standing, q), forces)


def after_impact(q, rates):
    """Rates of the old stance and swing leg when the swing foot has come down and stays."""

    def foot(floating):
        return floating[:2] + LENGTH * jnp.array([jnp.sin(floating[3]), -jnp.cos(floating[3])])

    def whole(q):
        return jnp.array([-LENGTH * jnp.sin(q[0]), LENGTH * jnp.cos(q[0]), q[0], q[1]])

    floating, before = jax.jvp(whole, (q,), (rates,))
    mass, row = mass_matrix(points, floating), jax.jacfwd(foot)(floating)
    blocks = jnp.block([[mass, -row.T], [row, jnp.zeros((2, 2))]])
    return jnp.linalg.solve(blocks, jnp.concatenate([mass @ before, jnp.zeros(2)]))[2:4]


def lobatto(count):
    """Points in [0, 1], the matrix of derivatives at them, and weights of the integral."""
    series = np.polynomial.legendre.Legendre.basis(count - 1)
    inner = np.sort(series.deriv().roots().real)
    for _ in range(3):
        inner -= series.deriv()(inner) / series.deriv(2)(inner)
    x = np.concatenate([[-1.0], inner, [1.0]])
    weights = 2.0 / (count * (count - 1) * series(x) ** 2)
    apart = x[:, None] - x[None, :] + np.eye(count)
    matrix = series(x)[:, None] / series(x)[None, :] / apart
    matrix -= np.diag(np.diag(matrix))
    matrix -= np.diag(matrix.sum(axis=1))
    return 0.5 * (x + 1.0), 2.0 * matrix, 0.5 * weights


def grid(segments, count):
    """Points in [0, 1], matrices of derivatives and weights: Lobatto's in each of some segments.

    Neighbours share their point. Rows of derivatives are all but the first of each segment.
    """
    x, matrix, weights = lobatto(count)
    total = segments * (count - 1) + 1
    points, rows, summed = np.zeros(total), np.zeros((total - 1, total)), np.zeros(total)
    for k in range(segments):
        own = slice(k * (count - 1), k * (count - 1) + count)
        points[own] = (k + x) / segments
        rows[k * (count - 1) : (k + 1) * (count - 1), own] = segments * matrix[1:]
        summed[own] += weights / segments
    return points, rows, summed


def cheapest(torque, parameters, begin, *, length=0.4, period=0.7, segments=8, count=9, steps=30):
    """The least ∫u² and its parameters, by Newton's method on the conditions of optimality.

    Args:
        torque: of (stance and swing angle, their rates, time [s], parameters).
        parameters: to begin with, shape (p,).
        begin: the state to begin with as a function of time [s], shape (4,).
        length, period: of a step [m, s].
        segments, count: how many there are, and points in each.
        steps: of Newton's method, at most.

    Returns:
        The cost, the parameters, and by how much the last step moved and the conditions are missed.
    """
    times, matrix, weights = (jnp.asarray(part) for part in grid(segments, count))
    half, many = float(np.arcsin(0.5 * length / LENGTH)), len(times)

    def parts(unknowns):
        return unknowns[: 4 * many].reshape(many, 4), unknowns[4 * many :]

    def torques(unknowns):
        states, law = parts(unknowns)
        return jax.vmap(lambda y, t: torque(y[:2], y[2:], t, law))(states, period * times)

    def cost(unknowns):
        return period * weights @ torques(unknowns) ** 2

    def missed(unknowns):
        states, _ = parts(unknowns)
        own = jax.vmap(accelerations)(states[:, :2], states[:, 2:], torques(unknowns))
        rates = jnp.concatenate([states[:, 2:], own], axis=1)
        defects = matrix @ states - period * rates[1:]
        first, last = states[0], states[-1]
        behind = after_impact(last[:2], last[2:])
        ends = jnp.array([first[0] - half, first[1] + half, last[0] + half, last[1] - half])
        # Legs exchange their names at the strike.
        return jnp.concatenate([defects.ravel(), ends, first[2:] - behind[::-1]])

    def conditions(both):
        unknowns, multipliers = (
            both[: 4 * many + len(parameters)],
            both[4 * many + len(parameters) :],
        )
        slopes = jax.grad(lambda z: cost(z) + multipliers @ missed(z))(unknowns)
        return jnp.concatenate([slopes, missed(unknowns)])

    start = jnp.concatenate([jnp.stack([begin(period * t) for t in times]).ravel(), parameters])
    rows = jax.jacfwd(missed)(start)
    guess, *_ = jnp.linalg.lstsq(rows.T, -jax.grad(cost)(start))
    both = jnp.concatenate([start, guess])
    value, slopes = jax.jit(conditions), jax.jit(jax.jacfwd(conditions))
    for _ in range(steps):
        move = jnp.linalg.solve(slopes(both), -value(both))
        both = both + move
        if float(jnp.max(jnp.abs(move[: len(start)]))) < 1e-12:
            break
    unknowns = both[: len(start)]
    moved, off = (float(jnp.max(jnp.abs(x))) for x in (move[: len(start)], missed(unknowns)))
    return float(cost(unknowns)), np.asarray(parts(unknowns)[1]), moved, off
