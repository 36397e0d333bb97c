"""Maps in closed form as curves of fixed points: their bifurcations are known."""

import numpy as np

from jaxbiped.continuation import Axis
from jaxbiped.continuation._branch_point import change_of
from jaxbiped.continuation._cycle import Cycle
from jaxbiped.gait._pseudo_arclength import Curve, correct


def curve_of(step, jacobian, bounds, *, footsteps=1, code=lambda point, value: 0):
    """The fixed points of a map's power, a component that forgets all beside its own, and its axis.

    `step(point, value)` and `jacobian(point, value)`, the latter with a last column by the value.
    """
    axis = Axis("slope", *bounds, log=False, leaf=0)
    m = len(step(np.ones(9), 1.0)) + 1

    def cycle(point, value):
        x, total = point[:-1], np.eye(m - 1, m)
        for _ in range(footsteps):
            own = jacobian(x, value)
            total = own[:, :-1] @ total + np.pad(own[:, -1:], ((0, 0), (m - 1, 0)))
            x = step(x, value)
        whole = np.zeros((m, m + 1))
        whole[:-1, : m - 1], whole[:-1, m] = total[:, :-1], total[:, -1]
        return twice(
            recurring=np.append(x, 0.0),
            jacobian=whole,
            monodromy=np.eye(m),
            velocity=np.eye(m)[-1],
            period=1.0,
            advance=1.0,
            peak=0.0,
            code=code(x, value),
            sound=True,
            grazes=0,
        )

    def change(point, s):
        return change_of(cycle(point, axis.value(s)), point, axis.slope(s))

    return Curve(change, np.ones(m + 1), 1e-11), axis


def twice(**leaves):
    """A cycle whose witness says the same."""
    return Cycle(**{name: np.stack([np.asarray(leaf)] * 2) for name, leaf in leaves.items()})


def begin_at(curve, axis, point, value):
    """The fixed point near a point, its tangent towards larger values."""
    place = np.array([*point, 0.0, axis.place(value)])
    found = correct(curve, place).found
    assert found is not None
    return found


def logistic(bounds, **options):
    """x → r x (1 − x): its doublings at 3, 1 + √6, 3.5440903596…."""
    return curve_of(
        lambda x, r: np.array([r * x[0] * (1.0 - x[0])]),
        lambda x, r: np.array([[r * (1.0 - 2.0 * x[0]), x[0] * (1.0 - x[0])]]),
        bounds,
        **options,
    )


def saddle_node(bounds):
    """x → x + r − x²: a fold at r = 0."""
    return curve_of(
        lambda x, r: np.array([x[0] + r - x[0] ** 2]),
        lambda x, r: np.array([[1.0 - 2.0 * x[0], 1.0]]),
        bounds,
    )


def delayed_logistic(bounds):
    """(x, y) → (r x (1 − y), x): a Neimark–Sacker point at r = 2, multipliers exp(± i π/3)."""
    return curve_of(
        lambda x, r: np.array([r * x[0] * (1.0 - x[1]), x[0]]),
        lambda x, r: np.array(
            [[r * (1.0 - x[1]), -r * x[0], x[0] * (1.0 - x[1])], [1.0, 0.0, 0.0]]
        ),
        bounds,
    )


def pitchfork(bounds):
    """x → x + r x − x³: branches cross at r = 0."""
    return curve_of(
        lambda x, r: np.array([x[0] + r * x[0] - x[0] ** 3]),
        lambda x, r: np.array([[1.0 + r - 3.0 * x[0] ** 2, x[0]]]),
        bounds,
    )
