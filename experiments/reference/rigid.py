"""The rigid walker: rolling, plastic impacts and walks, many at once, in NumPy alone.

Angles and rates are those of the swing leg and of the stance leg: y = (θ1, θ2, ω1, ω2), of shape
(4,) or (4, n). Rolling is by d'Alembert's principle, an impact by multipliers.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp


@dataclasses.dataclass(frozen=True)
class RigidWalker:
    """The rigid walker's numbers, SI units; the seed's unless given.

    Attributes:
        m, J, l, d, r, hip_mass, g, slope: as the paper has them.
        torques: of y, on both legs (2,) or (2, n), none unless given.
        push_off: impulse along the stance leg before an impact [N s].
    """

    m: float = 1.0
    J: float = 0.0096
    l: float = 0.40
    d: float = 0.10
    r: float = 0.08
    hip_mass: float = 0.0
    g: float = 9.8
    slope: float = 0.02
    torques: Callable[[np.ndarray], np.ndarray] | None = None
    push_off: float = 0.0

    @property
    def reach(self) -> float:
        """From the hip to the centre of a foot [m]."""
        return self.l - self.r

    @property
    def pull(self) -> np.ndarray:
        """Gravity along the slope and its normal, (2, 1)."""
        return self.g * np.array([[np.sin(self.slope)], [-np.cos(self.slope)]])

    def rates(self, y: np.ndarray) -> np.ndarray:
        """Of angles and rates, as y."""
        y = np.asarray(y)
        return self._motion(y.reshape(4, -1))[0].reshape(y.shape)

    def force(self, y: np.ndarray) -> np.ndarray:
        """The ground's on the stance foot along the slope and its normal [N], (2,) or (2, n)."""
        y = np.asarray(y)
        return self._motion(y.reshape(4, -1))[1].reshape(2, *y.shape[1:])

    def _motion(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rates (4, n), and the force by Newton's law for the whole (2, n).

        Each mass has velocities by the two rates and an acceleration that needs no change of them.
        """
        swing, stance, of_swing, of_stance = y
        hip = -self.reach * _along(stance) - self.r * np.array([[1.0], [0.0]])
        bend = -self.reach * _inward(stance) * of_stance**2
        centre, own = self.d * _along(swing), hip + self.d * _along(stance)
        parts = (
            (self.hip_mass, 0.0 * hip, hip, bend),
            (self.m, centre, hip, bend + self.d * _inward(swing) * of_swing**2),
            (self.m, 0.0 * hip, own, bend + self.d * _inward(stance) * of_stance**2),
        )
        dot = lambda a, b: (a * b).sum(axis=0)  # noqa: E731
        a = sum(mass * dot(u, u) for mass, u, _, _ in parts) + self.J
        b = sum(mass * dot(u, v) for mass, u, v, _ in parts)
        c = sum(mass * dot(v, v) for mass, _, v, _ in parts) + self.J
        first = sum(mass * dot(u, self.pull - rest) for mass, u, _, rest in parts)
        second = sum(mass * dot(v, self.pull - rest) for mass, _, v, rest in parts)
        if self.torques is not None:
            on_1, on_2 = self.torques(y)
            first, second = first + on_1, second + on_2
        whole = a * c - b * b
        alpha_1, alpha_2 = (c * first - b * second) / whole, (a * second - b * first) / whole
        force = sum(
            mass * (u * alpha_1 + v * alpha_2 + rest - self.pull) for mass, u, v, rest in parts
        )
        return np.array([of_swing, of_stance, alpha_1, alpha_2]), np.asarray(force)

    def mass_matrix(self, y: np.ndarray) -> np.ndarray:
        """Of (hip x, hip z, θ1, θ2) without any contact, (n, 4, 4)."""
        matrix = np.zeros((y.shape[1], 4, 4))
        matrix[:, 0, 0] = matrix[:, 1, 1] = self.hip_mass + 2.0 * self.m
        matrix[:, 2, 2] = matrix[:, 3, 3] = self.J + self.m * self.d**2
        for i, angle in enumerate(y[:2]):
            matrix[:, :2, 2 + i] = matrix[:, 2 + i, :2] = self.m * self.d * _along(angle).T
        return matrix

    def contact_rows(self, y: np.ndarray, leg: int) -> np.ndarray:
        """Velocity of the point of a foot that touches, by the four rates, (n, 2, 4)."""
        rows = np.zeros((y.shape[1], 2, 4))
        rows[:, 0, 0] = rows[:, 1, 1] = 1.0
        rows[:, :, 2 + leg] = (self.reach * _along(y[leg]) + self.r * np.array([[1.0], [0.0]])).T
        return rows

    def whole_rates(self, y: np.ndarray) -> np.ndarray:
        """Of the hip and both angles while the stance foot rolls, (n, 4)."""
        hip = -(self.reach * _along(y[1]) + self.r * np.array([[1.0], [0.0]])) * y[3]
        return np.array([*hip, y[2], y[3]]).T

    def impact(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The four rates after foot 1 has struck (n, 4), and its impulse (n, 2), by old names.

        Momenta change by the push-off along the stance leg and by an impulse that makes foot 1
        roll.
        """
        y = np.asarray(y, float).reshape(4, -1)
        matrix, rows = self.mass_matrix(y), self.contact_rows(y, 0)
        momenta = np.einsum("nij,nj->ni", matrix, self.whole_rates(y))
        momenta[:, :2] += self.push_off * _inward(y[1]).T
        # The push is on the centre of foot 2, which the leg's turning does not move along it.
        system = np.zeros((y.shape[1], 6, 6))
        system[:, :4, :4], system[:, 4:, :4] = matrix, rows
        system[:, :4, 4:] = -rows.transpose(0, 2, 1)
        wanted = np.concatenate([momenta, np.zeros((y.shape[1], 2))], axis=1)[..., None]
        found = np.linalg.solve(system, wanted)[..., 0]
        return found[:, :4], found[:, 4:]

    def after_impact(self, y: np.ndarray) -> np.ndarray:
        """Angles and rates once the legs have changed places, as y."""
        after = self.impact(y)[0]
        found = np.array([np.atleast_1d(y[1]), np.atleast_1d(y[0]), after[:, 3], after[:, 2]])
        return found.reshape(np.shape(y))

    def until_strike(self, y: np.ndarray, drop: float = 0.0) -> Any:
        """A swing as `solve_ivp` gives it; the ground lies lower by `drop` where it ends."""

        def strikes(t: float, y: np.ndarray) -> float:
            height = self.reach * (np.cos(y[1]) - np.cos(y[0])) + drop
            return height if y[0] > y[1] + 0.05 else 1.0

        strikes.terminal, strikes.direction = True, -1  # type: ignore[attr-defined]
        return solve_ivp(
            lambda t, y: self.rates(y), (0.0, 5.0), np.asarray(y), "DOP853",
            rtol=1e-12, atol=1e-13, events=strikes, dense_output=True,
        )  # fmt: skip

    def footstep(self, y: np.ndarray, drop: float = 0.0) -> tuple[np.ndarray, float]:
        """Angles and rates after the next impact, and when it comes."""
        solved = self.until_strike(y, drop)
        return self.after_impact(solved.y_events[0][0]), solved.t_events[0][0]

    def needed_friction(self, y: np.ndarray) -> float:
        """Least coefficient that keeps the stance foot from slipping before the next impact [–]."""
        solved = self.until_strike(y)
        along, normal = self.force(solved.sol(np.linspace(0.0, solved.t_events[0][0], 1001)))
        return float(np.max(np.abs(along) / normal))


def rigid_walker(scene: Any, **options: Any) -> RigidWalker:
    """The walker with the numbers of a scene of jaxbiped's."""
    walker, ground = scene.walker, scene.ground
    own = {name: float(getattr(walker, name)) for name in ("m", "J", "l", "d", "r", "hip_mass")}
    return RigidWalker(**own, g=float(ground.g), slope=float(ground.slope), **options)


def _along(angle: np.ndarray) -> np.ndarray:
    """Direction in which a leg's end moves as its angle grows, (2, n)."""
    return np.array([np.cos(angle), np.sin(angle)])


def _inward(angle: np.ndarray) -> np.ndarray:
    """Direction from a leg's end to the hip, (2, n)."""
    return np.array([-np.sin(angle), np.cos(angle)])
