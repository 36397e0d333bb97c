"""A second discretisation of optimal steps: Gauss collocation, and Newton's method for an optimum.

It shares nothing with the package: it has its own equations of motion of planar bodies on a point
foot and its own impact, states at collocation points are unknowns, and second derivatives are
exact. It begins near an optimum and tells the cost where the conditions of optimality hold.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import scipy.sparse
import scipy.sparse.linalg

G = 9.81


class Body(NamedTuple):
    """A body on the one before it, or on the hip for parent −1; its angle is from the vertical.

    Attributes:
        mass, inertia: about its centre.
        centre, length: how far along the body its centre and its end are, downwards.
        parent: number of the body at whose end it hangs.
    """

    mass: float
    inertia: float
    centre: float
    length: float
    parent: int = -1


class Step(NamedTuple):
    """A walker's step that is sought.

    Attributes:
        bodies: all; `swing` and `stance` are the numbers of those that carry the feet.
        hip_mass: at the hip.
        swing, stance: see above.
        mirror: the number that each body has when the legs are exchanged.
        motors: rows of weights of absolute angles, shape (r, n): the angles on which motors act.
        torques: `torques(angles, rates, share, parameters)` of the motors, shape (r,), where
            `share` is the time as a part of the period.
        conditions: `conditions(length, period, parameters)` that must be zero.
    """

    bodies: tuple[Body, ...]
    hip_mass: float
    swing: int
    stance: int
    mirror: tuple[int, ...]
    motors: np.ndarray
    torques: Callable[[Any, Any, Any, Any], Any]
    conditions: Callable[[Any, Any, Any], Any]

    def place(self, q: Any, number: int, along: float) -> Any:
        """A point of a body, from the hip."""
        body = self.bodies[number]
        from_hip = along * jnp.stack([jnp.sin(q[number]), -jnp.cos(q[number])])
        if body.parent < 0:
            return from_hip
        return from_hip + self.place(q, body.parent, self.bodies[body.parent].length)

    def foot(self, q: Any, number: int) -> Any:
        return self.place(q, number, self.bodies[number].length)

    def ahead(self, q: Any) -> Any:
        """The swing foot, from the standing one."""
        return self.foot(q, self.swing) - self.foot(q, self.stance)

    def points(self, both: Any) -> Any:
        """The hip and all centres (n + 1, 2), by angles and the place of the hip behind them."""
        q, hip = both[:-2], both[-2:]
        centres = [hip + self.place(q, i, body.centre) for i, body in enumerate(self.bodies)]
        return jnp.stack([hip, *centres])

    def mass_matrix(self, both: Any) -> Any:
        """By angles and the hip's place."""
        slopes = jax.jacfwd(self.points)(both)
        masses = jnp.array([self.hip_mass, *(body.mass for body in self.bodies)])
        inertias = jnp.array([*(body.inertia for body in self.bodies), 0.0, 0.0])
        return jnp.einsum("p,pai,paj->ij", masses, slopes, slopes) + jnp.diag(inertias)

    def rates(self, x: Any, share: Any, parameters: Any) -> Any:
        """Rates of angles and their rates, by Lagrange's equations with the hip above the foot."""
        n = len(self.bodies)
        q, v = x[:n], x[n:]

        def with_hip(q: Any) -> Any:
            return jnp.concatenate([q, -self.foot(q, self.stance)])

        def mass(q: Any) -> Any:
            along = jax.jacfwd(with_hip)(q)
            return along.T @ self.mass_matrix(with_hip(q)) @ along

        def potential(q: Any) -> Any:
            masses = jnp.array([self.hip_mass, *(body.mass for body in self.bodies)])
            return G * masses @ self.points(with_hip(q))[:, 1]

        matrix, change = jax.jvp(mass, (q,), (v,))
        kinetic = jax.grad(lambda q: 0.5 * v @ mass(q) @ v)(q)
        torques = self.torques(q, v, share, parameters)
        forces = self.motors.T @ torques - change @ v + kinetic - jax.grad(potential)(q)
        return jnp.concatenate([v, jnp.linalg.solve(matrix, forces)])

    def landed(self, x: Any) -> Any:
        """The state behind the strike: the swing foot stays, the other leaves, legs exchanged."""
        n = len(self.bodies)
        q, v = x[:n], x[n:]
        both = jnp.concatenate([q, -self.foot(q, self.stance)])
        before = jnp.concatenate([v, -jax.jvp(lambda q: self.foot(q, self.stance), (q,), (v,))[1]])
        matrix = self.mass_matrix(both)
        held = jax.jacfwd(lambda both: both[-2:] + self.foot(both[:-2], self.swing))(both)
        whole = jnp.block([[matrix, -held.T], [held, jnp.zeros((2, 2))]])
        after = jnp.linalg.solve(whole, jnp.concatenate([matrix @ before, jnp.zeros(2)]))[:n]
        order = jnp.array(self.mirror)
        return jnp.concatenate([q[order], after[order]])

    def course(self, share: Any, local: Any) -> Any:
        """Rates by the share of the period, and that of ∫u², of a state, period and parameters."""
        n = len(self.bodies)
        x, period, parameters = local[: 2 * n], local[2 * n], local[2 * n + 1 :]
        torques = self.torques(x[:n], x[n:], share, parameters)
        rates = self.rates(x, share, parameters)
        return period * jnp.append(rates, jnp.sum(torques**2))

    def ends(self, local: Any) -> Any:
        """What must be zero of the first state, the last one, the period and the parameters."""
        n = len(self.bodies)
        first, last, period = local[: 2 * n], local[2 * n : 4 * n], local[4 * n]
        ahead = self.ahead(last[:n])
        more = jnp.atleast_1d(self.conditions(ahead[0], period, local[4 * n + 1 :]))
        return jnp.concatenate([self.landed(last) - first, ahead[1:], more])


class Solution(NamedTuple):
    """Where all conditions hold.

    Attributes:
        cost: of the step.
        period, parameters: of it.
        missed: largest condition that is missed, or derivative that is not balanced.
        is_minimum: whether no direction along the conditions leads down, by the inertia of the
            matrix of KKT.
    """

    cost: float
    period: float
    parameters: np.ndarray
    missed: float
    is_minimum: bool


def gauss(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places, weights and the matrix of Gauss's collocation on the unit interval."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    places, powers = 0.5 * (nodes + 1.0), np.arange(1, count + 1)
    fit = np.linalg.inv(places[:, None] ** (powers - 1))
    return places, 0.5 * weights, (places[:, None] ** powers / powers) @ fit


def solve(
    step: Step,
    states: Callable[[np.ndarray], np.ndarray],
    period: float,
    parameters: np.ndarray,
    *,
    segments: int,
    points: int,
    iterations: int = 20,
) -> Solution:
    """Newton's method on the conditions of an optimum, from one that is near.

    Unknowns are the states where segments begin and at their Gauss points, the last state, the
    period and the parameters.

    Args:
        step: what is sought.
        states: of the step to begin from, by times, shape (k,) to (k, m): angles and rates.
        period, parameters: to begin from.
        segments, points: of the collocation: in each segment the states are polynomials of time.
        iterations: at most.
    """
    places, weights, matrix = gauss(points)
    m, each, r = 2 * len(step.bodies), points + 1, segments * points
    shares = np.append((np.arange(segments)[:, None] + np.append(0.0, places)) / segments, 1.0)
    inner = np.delete(np.arange(segments * each), np.arange(segments) * each)
    z = np.concatenate([states(period * shares).ravel(), [period], parameters])
    n, count = len(z), segments * each
    tail = np.arange((count + 1) * m, n)
    # A state less the first of its segment is a sum of rates; so is the next segment's first.
    of_rates = scipy.sparse.block_diag([np.vstack([matrix, weights]) / segments] * segments)
    begins = np.repeat(np.arange(segments) * each, each)
    ones, rows = np.ones(count), np.arange(count)
    of_states = scipy.sparse.coo_matrix(
        (np.append(ones, -ones), (np.append(rows, rows), np.append(begins, rows + 1)))
    )
    linear = scipy.sparse.kron(of_states, np.eye(m))
    of_cost = np.tile(weights, segments) / segments
    local = np.hstack([inner[:, None] * m + np.arange(m), np.tile(tail, (r, 1))])
    at_ends = np.r_[:m, count * m : n]
    course = jax.jit(jax.vmap(step.course))
    slopes = jax.jit(jax.vmap(jax.jacfwd(step.course, argnums=1)))
    bends = jax.jit(jax.vmap(jax.hessian(lambda s, x, y: y @ step.course(s, x), argnums=1)))
    end, end_slopes = jax.jit(step.ends), jax.jit(jax.jacfwd(step.ends))
    end_bends = jax.jit(jax.hessian(lambda x, y: y @ step.ends(x)))
    multipliers = None
    for _ in range(iterations):
        values = np.asarray(course(shares[inner], z[local]))
        by_local = np.asarray(slopes(shares[inner], z[local]))
        last, by_ends = np.asarray(end(z[at_ends])), np.asarray(end_slopes(z[at_ends]))
        cost = of_cost @ values[:, m]
        gaps = linear @ z[: (count + 1) * m] + (of_rates @ values[:, :m]).ravel()
        missed = np.concatenate([gaps, last])
        gradient = np.zeros(n)
        np.add.at(gradient, local, of_cost[:, None] * by_local[:, m])
        rates = _placed(by_local[:, :m], np.arange(r * m).reshape(r, m), local, (r * m, n))
        wide = scipy.sparse.hstack([linear, scipy.sparse.csr_matrix((count * m, len(tail)))])
        joints = wide + scipy.sparse.kron(of_rates, np.eye(m)) @ rates
        of_ends = _placed(by_ends[None], np.arange(len(last))[None], at_ends[None], (len(last), n))
        jacobian = scipy.sparse.vstack([joints, of_ends], format="csc")
        if multipliers is None:
            multipliers = -scipy.sparse.linalg.lsqr(jacobian.T, gradient, 0.0, 1e-12, 1e-12)[0]
        left = gradient + jacobian.T @ multipliers
        along, behind = np.split(multipliers, [count * m])
        of_values = np.hstack([of_rates.T @ along.reshape(count, m), of_cost[:, None]])
        inside = np.asarray(bends(shares[inner], z[local], of_values))
        hessian = _placed(inside, local, local, (n, n)) + _placed(
            np.asarray(end_bends(z[at_ends], behind))[None], at_ends[None], at_ends[None], (n, n)
        )
        both = scipy.sparse.bmat([[hessian, jacobian.T], [jacobian, None]], format="csc")
        change = scipy.sparse.linalg.splu(both).solve(-np.concatenate([left, missed]))
        z, multipliers = z + change[:n], multipliers + change[n:]
        if np.max(np.abs(change[:n])) < 1e-12 * np.max(np.abs(z)):
            break
    negative = int(np.sum(np.linalg.eigvalsh(both.toarray()) < 0.0))
    miss = float(max(np.max(np.abs(missed)), np.max(np.abs(left)) / cost))
    return Solution(float(cost), float(z[tail[0]]), z[tail][1:], miss, negative == len(multipliers))


def _placed(blocks: np.ndarray, rows: np.ndarray, columns: np.ndarray, shape: Any) -> Any:
    """Blocks (k, a, b) at rows (k, a) and columns (k, b) of a sparse matrix."""
    where = np.broadcast_to(rows[:, :, None], blocks.shape)
    there = np.broadcast_to(columns[:, None, :], blocks.shape)
    entries = blocks.ravel(), (where.ravel(), there.ravel())
    return scipy.sparse.coo_matrix(entries, shape=shape).tocsc()
