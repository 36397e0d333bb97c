"""Couplings of a mechanism, solved for the angles that they fix, and what these are."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped.scene._structure import Angle, Fixed, Structure, weighted

_SINGULAR = 1e-9
"""Couplings whose weights are so nearly dependent repeat or contradict each other."""


def with_fixed(
    structure: Structure, values: Sequence[Any], vertical: Any = None, joints: Sequence[Any] = ()
) -> list[Any]:
    """Values of all bodies' angles, those that couplings fix set from the others.

    Args:
        structure: of the mechanism.
        values: of all bodies; what stands for fixed ones is not read.
        vertical: angle of the vertical [rad]; None for rates and accelerations.
        joints: the joint parts, whose rest angles count; none for rates and accelerations.
    """
    found = list(values)
    for each in structure.fixed:
        own = each.angle.of(values, vertical)
        own = 0.0 * values[0] if own is None else own
        for k, weight in each.rests if joints else ():
            rest = joints[k].rest
            own = own if rest is None else own + weighted(rest, weight)
        found[each.body] = own
    return found


def angles_and_rates_named(
    mechanism: Any, slope: Any, values: Mapping[str, Any]
) -> tuple[list[Any], list[Any]]:
    """Angles and rates of all bodies, from a state's scalars by name; 0 where not named.

    `slope`: the angle of the vertical [rad].
    """
    structure = mechanism.structure
    angles, rates = (
        [values.get(f"{kind}_{name}", 0.0) for name in structure.bodies]
        for kind in ("theta", "omega")
    )
    fixed = with_fixed(structure, angles, slope, mechanism.joints)
    return fixed, with_fixed(structure, rates)


def fixed_angles(couplings: Sequence[tuple[int, Angle]], names: Sequence[str]) -> tuple[Fixed, ...]:
    """The angle of the first body that each coupling names, as a sum of those that stay free.

    Args:
        couplings: number of each one among the joint parts, and its angle.
        names: of the bodies.

    Raises:
        ArgumentError: an angle that two couplings fix, or couplings that repeat or contradict each
            other.
    """
    if not couplings:
        return ()
    first = [angle.weights[0][0] for _, angle in couplings]
    for body in first:
        if first.count(body) > 1:
            raise ArgumentError(
                f"two couplings name {names[body]!r} first, whose angle each would fix: name "
                "another body first in one of them."
            )
    weights = np.zeros((len(couplings), len(names)))
    for row, (_, angle) in enumerate(couplings):
        for body, weight in angle.weights:
            weights[row, body] = weight
    own = weights[:, first]
    if np.linalg.cond(own) * _SINGULAR > 1.0:
        raise ArgumentError(
            f"couplings of {', '.join(repr(names[body]) for body in first)} repeat or contradict "
            "each other: leave one out."
        )
    by_rest = np.linalg.inv(own)
    by_others = -by_rest @ weights
    by_slope = -by_rest @ np.array([angle.vertical for _, angle in couplings])
    return tuple(
        Fixed(
            body,
            Angle(
                tuple(
                    (j, float(by_others[row, j]))
                    for j in range(len(names))
                    if j not in first and by_others[row, j]
                ),
                float(by_slope[row]),
            ),
            tuple((k, float(by_rest[row, i])) for i, (k, _) in enumerate(couplings)),
        )
        for row, body in enumerate(first)
    )
