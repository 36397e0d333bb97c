"""Rigid walkers written a second time: their equations by hand, SciPy's solves.

Angles are those of the swinging leg and then those of the standing one, thigh and shank where a leg
has both. A place is a chain from the hip: lengths, each along the direction of an angle.
"""

import itertools

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

DEPARTING = 0.05
"""Time in which legs that were side by side part, though their feet are level then, too."""


class StraightLegs:
    """A walker whose feet of radius `r` roll, `l` from the hip to a foot's centre.

    `bodies` are (mass, inertia, place along the body from the hip, weights of its angle by those of
    the legs), beside a mass at the hip.
    """

    free = np.eye(2)
    """By the rates that can differ, those of all angles."""
    exchange = np.array([1, 0])
    """The angles of a leg's exchange."""

    def __init__(self, bodies, *, hip_mass, l, r=0.0, slope, g, impulse=0.0):
        self.bodies = [(m, J, [(along, w)], w) for m, J, along, w in bodies]
        self.bodies.append((hip_mass, 0.0, [], np.zeros(2)))
        self.leg = [(l, np.eye(2)[1])]
        self.l, self.r, self.impulse = l, r, impulse
        self.gravity = g * np.array([np.sin(slope), -np.cos(slope)])

    def motions(self, q, rates, leg):
        """Each body's velocity by the angles' rates, and its acceleration without these' own.

        The hip stands on the leg whose foot rolls; bodies hang on the hip.
        """
        moves, left = chain(leg, q, rates)
        hip, bent = -moves, -left
        hip[0] -= self.r * leg[-1][1]
        for mass, inertia, links, weights in self.bodies:
            moves, left = chain(links, q, rates)
            yield mass, inertia * np.outer(weights, weights), hip + moves, bent + left

    def mass_matrix(self, motions):
        return sum(mass * moves.T @ moves + turning for mass, turning, moves, _ in motions)

    def field(self, free):
        """Rates of all angles and of their rates: each body's momentum, seen along what is free."""

        def rates_of(_, y):
            q, rates = np.split(y, 2)
            motions = list(self.motions(q, rates, self.leg))
            force = sum(m * moves.T @ (self.gravity - left) for m, _, moves, left in motions)
            matrix = free.T @ self.mass_matrix(motions) @ free
            return np.concatenate([rates, free @ np.linalg.solve(matrix, free.T @ force)])

        return rates_of

    def kept(self, y, leg, free, push=(0.0, 0.0)):
        """Rates behind an impact, as seen along what is free behind it, on this leg."""
        q, rates = np.split(y, 2)
        before, after = (list(self.motions(q, rates, each)) for each in (self.leg, leg))
        momentum = sum(
            (m * now.T @ was + turning) @ rates
            for (m, turning, was, _), (_, _, now, _) in zip(before, after, strict=True)
        )
        matrix = free.T @ self.mass_matrix(after) @ free
        return free @ np.linalg.solve(matrix, free.T @ (momentum + push @ after[-1][2]))

    def struck(self, y):
        """Behind a heel strike, the legs exchanged; before it the leg behind pushes the hip."""
        other = [(length, weights[self.exchange]) for length, weights in self.leg]
        angle = y[len(y) // 2 - 1]
        push = self.impulse * np.array([-np.sin(angle), np.cos(angle)])
        rates = self.kept(y, other, self.free, push)
        return np.concatenate([y[: len(y) // 2][self.exchange], rates[self.exchange]])

    def solve(self, free, y, event, direction):
        """From a state to an event, with the time that it takes."""

        def fall(_, y):
            return 1.0 - max(abs(y[: len(y) // 2]))

        y, event = np.asarray(y, dtype=float), _terminal(event, direction)
        found = solve_ivp(self.field(free), (0.0, 9.0), y, events=(event, _terminal(fall)), **HOW)
        if not found.t_events[0].size:
            raise ValueError("the walker falls")
        return found.y[:, -1], found.t[-1]

    def footstep(self, point):
        """From behind a strike (stance leg's angle, both rates) to behind the next; the time."""
        y, first = self.solve(self.free, [-point[0], *point], lambda _, y: y[1] - y[0], 0.0)
        y = solve_ivp(self.field(self.free), (0.0, DEPARTING), y, **HOW).y[:, -1]
        y, last = self.solve(self.free, y, lambda _, y: y[0] + y[1], -1.0)
        return self.struck(y)[1:], first + DEPARTING + last

    def gait(self, near):
        """Fixed point of the footstep near a start, its period, and its multipliers."""
        point = root(lambda point: self.footstep(point)[0] - point, near, tol=1e-13).x
        h, slopes = 1e-4, []
        for each in np.eye(3):
            moved = {k: self.footstep(point + k * h * each)[0] for k in (-3, -2, -1, 1, 2, 3)}
            odd = [moved[k] - moved[-k] for k in (1, 2, 3)]
            slopes.append((45.0 * odd[0] - 9.0 * odd[1] + odd[2]) / (60.0 * h))
        multipliers = np.linalg.eigvals(np.stack(slopes, axis=1))
        return point, self.footstep(point)[1], multipliers[np.argsort(-abs(multipliers))]


class Knees(StraightLegs):
    """A walker with knees and point feet: `thigh`, `shank` are (mass, length, the mass's place).

    The standing knee is locked. The swinging one locks where it is straight, and lets go behind the
    heel strike.
    """

    free = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
    bent = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]])
    exchange = np.array([2, 3, 0, 1])

    def __init__(self, thigh, shank, *, hip_mass, slope, g):
        super().__init__([], hip_mass=hip_mass, l=0.0, slope=slope, g=g)
        angles = np.eye(4)
        self.bodies = [(hip_mass, 0.0, [], np.zeros(4))]
        for k in (0, 2):
            above = [(thigh[1], angles[k])]
            below = [*above, (shank[2], angles[k + 1])]
            self.bodies.insert(0, (thigh[0], 0.0, [(thigh[2], angles[k])], angles[k]))
            self.bodies.insert(0, (shank[0], 0.0, below, angles[k + 1]))
            self.leg = [*above, (shank[1], angles[k + 1])]

    def footstep(self, point):
        theta, swing, stance = point
        y = [-theta, -theta, theta, theta, swing, swing, stance, stance]
        y, first = self.solve(self.bent, y, lambda _, y: y[1] - y[0], 1.0)
        y = np.concatenate([y[:4], self.kept(y, self.leg, self.free)])
        y, last = self.solve(self.free, y, lambda _, y: y[1] + y[3], -1.0)
        return self.struck(y)[[3, 4, 7]], first + last


HOW = dict(method="DOP853", rtol=1e-13, atol=1e-14)


def _terminal(event, direction=0.0):
    event.terminal, event.direction = True, direction
    return event


def chain(links, q, rates):
    """Velocity of a chain's end by the angles' rates, and its acceleration without these' own."""
    moves, left = np.zeros((2, len(q))), np.zeros(2)
    for length, weights in links:
        angle, rate = weights @ q, weights @ rates
        moves += length * np.outer([np.cos(angle), np.sin(angle)], weights)
        left -= length * rate**2 * np.array([np.sin(angle), -np.cos(angle)])
    return moves, left


def straight_legs(mass, inertia, along):
    """Two equal legs."""
    return [(mass, inertia, along, weights) for weights in np.eye(2)]


def same_multipliers(ours, theirs):
    """Largest difference of two sets of multipliers, in the order that fits best.

    Equations by hand have no mode, and nothing that is held: ours have zeros for these.
    """
    theirs = np.append(theirs, np.zeros(len(ours) - len(theirs)))
    return min(
        np.max(np.abs(np.asarray(order) - np.asarray(theirs)))
        for order in itertools.permutations(ours)
    )
