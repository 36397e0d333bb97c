"""The seed's equations of motion and an integrator for them, written anew in numba and NumPy.

Collocation at Radau's points, of order nine. A step belongs to one branch of the contact, on which
the motion is smooth, and can tell where it leaves that branch, how large the normal forces become
and where displacements of its start go. Nothing here is shared with the package.
"""

import math

import numba
import numpy as np

TINY = 1e-30  # a step that rounds nothing away: f(y + i TINY v).imag / TINY is f'(y) v exactly
ALLOWED = 1e-10  # estimated error of a step; the estimate is of order h⁶, the error of order h¹⁰
FILTER = 0.1  # weight of the field at a step's start in that estimate


def _collocation(stages):
    """Radau's nodes, the method's matrix, the polynomials through the nodes, error weights."""
    basis = np.polynomial.legendre.Legendre.basis
    nodes = (np.sort((basis(stages - 1) - basis(stages)).roots().real) + 1.0) / 2.0
    nodes[-1] = 1.0
    through = np.linalg.inv(np.vander(nodes, increasing=True))
    order = np.arange(1, stages + 1)
    return nodes, (nodes[:, None] ** order / order) @ through, through, -FILTER * through[0]


NODES, MATRIX, THROUGH, WEIGHTS = _collocation(5)
ONES = np.eye(8 * NODES.size)


@numba.njit(cache=False)
def _rates(rows, p, branch):
    """Of states (k, 8), complex: rates (k, 8) on one branch, and the normal forces (k, 2)."""
    m, J, length, d, r, hip, g, slope, n, K, c, mu_s, mu_k, v0, xi = p
    total, md, inertia = 2.0 * m + hip, m * d, J + m * d * d
    out, normals = np.empty_like(rows), np.empty((rows.shape[0], 2), rows.dtype)
    for row in range(rows.shape[0]):
        y = rows[row]
        # The hip's equations without the legs' accelerations: [[xx, xz], [xz, zz]] a = (fx, fz).
        xx, xz, zz = total + 0j, 0j, total + 0j
        fx, fz = total * g * math.sin(slope) + 0j, -total * g * math.cos(slope) + 0j
        for i in range(2):
            w, sine, cosine = y[6 + i], np.sin(y[2 + i]), np.cos(y[2 + i])
            z, x = (length - r) * cosine + r, (length - r) * sine
            depth, rate = z - y[1], -(y[5] + x * w)
            carries, way, slow = branch[i]
            # Just before the ground the force is continued smoothly: a power of |depth|.
            size = math.copysign(1.0, depth.real) * depth
            normal = carries * (K * size**n + c * depth * rate)
            s = way * (y[4] + z * w)
            if slow > 0.0:
                friction = -way * mu_s * normal * (1.0 - ((s - v0) / v0) ** 2)
            else:
                friction = -way * normal * (mu_k + (mu_s - mu_k) * np.exp(-xi * (s - v0)))
            weight = math.sin(slope) * cosine - math.cos(slope) * sine
            torque = md * g * weight + normal * x + friction * z
            fx += md * sine * w * w + friction - md * cosine * torque / inertia
            fz += -md * cosine * w * w + normal - md * sine * torque / inertia
            xx -= (md * cosine) ** 2 / inertia
            zz -= (md * sine) ** 2 / inertia
            xz -= md * md * sine * cosine / inertia
            out[row, 6 + i], normals[row, i] = torque, normal
        ax = (fx * zz - fz * xz) / (xx * zz - xz * xz)
        az = (fz * xx - fx * xz) / (xx * zz - xz * xz)
        out[row, :4], out[row, 4], out[row, 5] = y[4:], ax, az
        for i in range(2):
            pulled = np.cos(y[2 + i]) * ax + np.sin(y[2 + i]) * az
            out[row, 6 + i] = (out[row, 6 + i] - md * pulled) / inertia
    return out, normals


def _contact(y, p):
    """Of states (…, 8), each foot's depth, force / depth, slip and its leg's rate, (…, 2) each."""
    angle, rate = y[..., 2:4], y[..., 6:8]
    z, x = (p[2] - p[4]) * np.cos(angle) + p[4], (p[2] - p[4]) * np.sin(angle)
    depth = z - y[..., 1:2]
    size = np.where(depth.real < 0.0, -depth, depth)
    force = p[9] * size ** (p[8] - 1.0) - p[10] * (y[..., 5:6] + x * rate)
    return depth, force, y[..., 4:5] + z * rate, rate


def branch_of(y, p):
    """Of each foot (…, 2, 3): whether it carries, which way it slips, whether slower than v0."""
    depth, force, slip, rate = _contact(y, p)
    carries = (depth > 0.0) & (rate < 0.0) & (force > 0.0)
    return carries[..., None] * np.stack([carries, np.sign(slip), np.abs(slip) < p[13]], axis=-1)


class Branch:
    """The smooth motion while each foot's contact stays as it is."""

    def __init__(self, p, branch):
        self.p, self.branch = p, branch

    def field(self, rows):
        return _rates(rows + 0j, self.p, self.branch)[0].real

    def along(self, y, v):
        """How rates and normal forces change along v."""
        rates, normals = _rates((y + TINY * 1j * v)[None], self.p, self.branch)
        return rates[0].imag / TINY, normals[0].imag / TINY

    def slopes(self, rows):
        """The field's Jacobians (k, 8, 8)."""
        moved = rows[:, None] + TINY * 1j * np.eye(8)
        rates = _rates(moved.reshape(-1, 8), self.p, self.branch)[0]
        return (rates.imag / TINY).reshape(-1, 8, 8).transpose(0, 2, 1)

    def delay(self, y):
        """Time from y to the nearest switch."""
        y = y + TINY * 1j * self.field(y[None])[0]
        depth, force, slip, rate = _contact(y, self.p)
        along = np.concatenate([depth, force, rate, slip, slip - self.p[13], slip + self.p[13]])
        delays = -along.real / (along.imag / TINY)
        return delays[np.argmin(np.abs(delays))]


class Step:
    """One step of h from y on a branch: the field at the nodes (5, 8), the end, the error."""

    def __init__(self, motion, y, h):
        self.motion, self.y, self.h = motion, y, h
        self.first, self.slopes = motion.field(y[None])[0], motion.slopes(y[None])[0]
        inverse = np.linalg.inv(ONES - h * np.kron(MATRIX, self.slopes))
        self.rates = np.tile(self.first, (NODES.size, 1))
        last, self.found = math.inf, False
        for _ in range(40):
            miss = motion.field(self.places) - self.rates
            change = (inverse @ miss.ravel()).reshape(miss.shape)
            self.rates += change
            size = h * np.max(np.abs(change))
            if self.found or not size < 1.0:
                break
            # Once rounding shows there is one more iteration.
            self.found = bool(size < 1e-15 or 1e-12 > size > 0.5 * last)
            last = size

    @property
    def places(self):
        return self.y + self.h * (MATRIX @ self.rates)

    @property
    def end(self):
        return self.y + self.h * (MATRIX[-1] @ self.rates)

    @property
    def error(self):
        """As a share of the allowed, stiff parts damped."""
        if not self.found:
            return math.inf
        error = self.h * (FILTER * self.first + WEIGHTS @ self.rates)
        damped = np.linalg.solve(np.eye(8) - FILTER * self.h * self.slopes, error)
        return np.max(np.abs(damped)) / ALLOWED

    @property
    def left(self):
        """The share of the step after which the contact is on another branch, or None."""
        p, branch = self.motion.p, self.motion.branch
        leaves = np.any(branch_of(self.places, p) != branch, axis=(1, 2))
        if not np.any(leaves):
            return None
        low, high, order = 0.0, NODES[np.argmax(leaves)], np.arange(1, NODES.size + 1)
        shares = self.h * (THROUGH @ self.rates)
        for _ in range(30):
            middle = (low + high) / 2.0
            gone = np.any(branch_of(self.y + (middle**order / order) @ shares, p) != branch)
            low, high = (low, middle) if gone else (middle, high)
        return high

    @property
    def peak(self):
        """The largest normal force, at the end or where a foot's passes a maximum."""
        motion, end = self.motion, self.end
        load = lambda y: _rates(y[None] + 0j, motion.p, motion.branch)[1][0].real
        growth = lambda y: motion.along(y, motion.field(y[None])[0])[1]
        largest, before, after = np.max(load(end)), growth(self.y), growth(end)
        for foot in np.flatnonzero((before > 0.0) & (after < 0.0)):
            low, high = (0.0, before[foot]), (self.h, after[foot])
            for _ in range(4):
                at = (low[0] * high[1] - high[0] * low[1]) / (high[1] - low[1])
                place = Step(motion, self.y, at).end
                value = growth(place)[foot]
                low, high = ((at, value), high) if value > 0.0 else (low, (at, value))
                largest = max(largest, load(place)[foot])
        return largest

    def carried(self, moved):
        """Displacements (8, k) at the end: the same method for the variational equation."""
        slopes = self.motion.slopes(self.places)
        blocks = np.einsum("ij,iab->iajb", MATRIX, slopes)
        rates = np.linalg.solve(
            ONES - self.h * blocks.reshape(ONES.shape), np.concatenate(slopes @ moved)
        )
        return moved + self.h * np.tensordot(MATRIX[-1], rates.reshape(NODES.size, 8, -1), 1)
