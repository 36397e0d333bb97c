"""Gaits at extremes: their multipliers and sensitivities against the check's."""

import dataclasses
import time
import warnings
from collections.abc import Iterator
from typing import Any

import jax.numpy as jnp
import numpy as np
from reference.gait_derivatives import apart, checked_gait

import jaxbiped as jb

from .case import check_numbers, key_of
from .catalogue import parameters_at
from .verdict import SURE, Verdict

WANTED = 1e-2
"""Relative error asked of gaits."""
_VARIED = {"K": 10, "c": 11, "xi": 19}
"""Parameters with respect to which periods are differentiated, and their places in the check."""
_CHAINS: dict[str, tuple[tuple[float, ...], ...]] = {
    "K": (tuple(np.geomspace(1e6, 1e10, 13)), tuple(np.geomspace(1e6, 1e3, 10)[1:])),
    "c": (tuple(np.geomspace(1e7, 1e10, 10)[1:]), tuple(np.geomspace(1e7, 1e2, 16)[1:])),
    "n": (
        (1.6, 1.75, 2.0, 2.25, 2.5, 2.75, 3.0, 3.25, 3.5, 3.75, 4.0),
        (1.4, 1.3, 1.2, 1.1, 1.05, 1.0),
    ),
    "v0": (tuple(np.geomspace(1e-4, 1.0, 13)[1:]), tuple(np.geomspace(1e-4, 1e-9, 16)[1:])),
    "xi": (tuple(np.geomspace(1e3, 1e8, 16)[1:]), (*np.geomspace(1e3, 1e-2, 11)[1:], 0.0)),
    "mu": ((0.6, 0.8, 1.0, 1.3, 1.7, 2.2, 3.0, 4.0, 5.0), (0.45, 0.4, 0.35, 0.3, 0.25, 0.2, 0.15)),
    "slope": (
        (0.022, 0.025, 0.028, 0.032, 0.036, 0.04, 0.045, 0.05, 0.055, 0.06, 0.07, 0.08),
        (0.018, 0.016, 0.014, 0.012, 0.01, 0.008),
    ),
    "hip mass": (
        (0.01, 0.03, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 30.0, 100.0),
    ),
}
"""Values of each parameter from the seed's outwards: each gait is sought from the last."""


@dataclasses.dataclass(frozen=True)
class GaitCase:
    """A gait at an extreme.

    Attributes:
        group: the parameter that is changed.
        at: its value by name.
        parameters: of the scene, arguments of `seed_scene`.
        first: whether a chain of gaits begins here, from the seed's start.
    """

    group: str
    at: dict[str, float]
    parameters: dict[str, float]
    first: bool

    @property
    def key(self) -> str:
        """A name for the store, the same wherever the case is the same."""
        return f"gait-{key_of(self)}"


def gaits(*, quick: bool = False) -> Iterator[GaitCase]:
    """Gaits along each parameter, from the seed's outwards."""
    for name, chains in _CHAINS.items():
        for chain in chains:
            for k, value in enumerate(chain[:2] if quick else chain):
                at = float(value)
                yield GaitCase(name, {name: at}, parameters_at(name, at), first=k == 0)
        if quick:
            return


class GaitJudge:
    """Judges gaits one after another, each search from the gait before."""

    def __init__(self) -> None:
        self._near: tuple[float, ...] = ()

    def __call__(self, case: GaitCase) -> Verdict:
        """The verdict on a gait."""
        if case.first:
            self._near = ()
        verdict = _judged(case, self._near)
        self.follow(dataclasses.asdict(verdict))
        return verdict

    def follow(self, row: dict[str, Any]) -> None:
        """Goes on from a gait that a store holds."""
        self._near = tuple(row["state"]) or self._near


def _judged(case: GaitCase, near: tuple[float, ...]) -> Verdict:
    begun = time.perf_counter()
    guess = jb.State(*map(jnp.asarray, (0.0, *near))) if near else None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # the error estimate tells it, too
        try:
            scene = jb.seed_scene(**case.parameters)
            how = dict(parameters=tuple(_VARIED), accuracy=WANTED, radius_sensitivities=False)
            gait = jb.find_gait(scene, guess, max_evaluations=60, **how)
        except jb.ArgumentError as error:
            return Verdict("refused", str(error))
    seconds = time.perf_counter() - begun
    known: dict[str, Any] = dict(outcome=str(gait.outcome), wanted=WANTED, seconds=seconds)
    if gait.outcome is not jb.gait.Search.FOUND:
        return Verdict("flagged", f"the search ended as {gait.outcome}", **known)
    state = tuple(float(leaf) for leaf in gait.measures.state if leaf is not None)[-7:]
    known |= dict(told=float(gait.error.relative), state=state)
    start, period = np.array([0.0, *state]), float(gait.measures.period)
    check = checked_gait(start, period, check_numbers(scene), tuple(_VARIED.values()))
    if check is None:
        return Verdict("unresolved", "the check's solve fails", **known)
    unit = max(float(np.max(np.abs(check.elasticities))), 1e-30)
    errors = (
        apart(check.multipliers, np.append(np.asarray(gait.multipliers), 1.0)),
        float(np.max(np.abs(np.asarray(gait.elasticities.period) - check.elasticities))) / unit,
    )
    doubts = (check.doubt_multipliers, check.doubt_elasticities / unit)
    known |= dict(multipliers=errors[0], elasticities=errors[1], doubts=doubts)
    if not gait.error.met:
        return Verdict("flagged", f"accuracy not met: {gait.error.reason}", **known)
    wrong = any(e > WANTED and d <= SURE * e for e, d in zip(errors, doubts, strict=True))
    if wrong:
        return Verdict("silently_wrong", "a derivative is off", **known)
    if not max(doubts) <= SURE * WANTED:
        return Verdict("unresolved", "the check's own differences part", **known)
    return Verdict("accurate", **known)
