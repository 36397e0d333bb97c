"""Basins whose boundaries are known, and a record of what was asked."""

import numpy as np


class Recorded:
    """A labelling that keeps the points of every call."""

    def __init__(self, label_of):
        self.label_of = label_of
        self.calls = []

    def __call__(self, points):
        self.calls.append(points.copy())
        return self.label_of(points)

    @property
    def points(self):
        return np.concatenate(self.calls)


def half_space(normal, offset):
    """Label 1 beyond the plane normal · x = offset."""
    return lambda points: (points @ np.asarray(normal, dtype=float) > offset).astype(int)


def ball(centre, radius):
    """Label 1 within a ball."""
    centre = np.asarray(centre, dtype=float)
    return lambda points: (np.linalg.norm(points - centre, axis=1) < radius).astype(int)


def newton(points):
    """Which cube root of 1 Newton's method reaches; its boundary's dimension is about 1.42."""
    z = points[:, 0] + 1j * points[:, 1]
    for _ in range(40):
        z = z - (z**3 - 1.0) / (3.0 * z**2)
    return np.argmin(abs(z[:, None] - np.exp(2j * np.pi * np.arange(3) / 3)), axis=1)


NEWTON_BOX = ((-1.5, -1.43), (1.57, 1.61))


def cantor(points):
    """Parity of the tripling at which x leaves by a middle third.

    The boundary is Cantor's middle-thirds set, of dimension log 2 / log 3.
    """
    x = points[:, 0].copy()
    when = np.full(len(x), -1)
    for k in range(34):
        when[(when < 0) & (x > 1 / 3) & (x < 2 / 3)] = k
        x = np.clip(np.where(x < 0.5, 3.0 * x, 3.0 * (1.0 - x)), -1.0, 2.0)
    return np.where(when < 0, 0, when % 2)


def on_lattice(label_of, lower, upper, counts):
    """Labels of a full grid, shape `counts`, by one call."""
    axes = [np.linspace(a, b, n) for a, b, n in zip(lower, upper, counts, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return label_of(points.reshape(-1, len(counts))).reshape(counts)
