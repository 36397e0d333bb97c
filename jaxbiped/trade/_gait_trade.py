"""Trade of a gait: period, largest multiplier and the period's gradient, against cost."""

from typing import NamedTuple

import jax
import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.scene._parameter_access import parameter_names
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.solve._accuracy import Precision
from jaxbiped.trade._reference_solution import Truth, Values, truth_of
from jaxbiped.trade._study_row import OK, Row, Way, failed_row, row_of, work_of

TANGENT_SHARE = 10.0
"""Tolerance of the columns, in units of the state's, as in the named accuracies."""
_FINEST = {True: 1e-11, False: 1e-13}
"""Of the references, of compliant walkers and of rigid ones."""
_REFERENCES = ("rodas5p", "rodas4p")
_OF_CONTACT = ("K", "c", "xi")
_MOST_EVALUATIONS = 40


class GaitTrade(NamedTuple):
    """A gait to be found in many ways, from the seed's start fitted to the scene.

    Attributes:
        scene: the walker.
        repeats: warm runs of which the median counts.
    """

    scene: Scene | RigidScene | RedundantScene
    repeats: int = 3

    @property
    def parameters(self) -> tuple[str, ...]:
        """What the period is differentiated by: K, c and ξ where there are such, else the slope."""
        known = parameter_names(self.scene)
        return tuple(name for name in _OF_CONTACT if name in known) or ("slope",)

    def truth(self) -> Truth | None:
        """By Rodas5P at the finest tolerance, its floor by Rodas4P's; None without a gait."""
        finest = _FINEST[self.scene.compliant]
        first, second = (self.values(Way(s, "auto", "", finest)) for s in _REFERENCES)
        return None if first is None or second is None else truth_of(first, second)

    def values(self, way: Way) -> Values | None:
        """What a way gives; None where it finds no gait."""
        gait = self.find(way)
        return gait_values(gait) if gait.outcome is Search.FOUND else None

    def row(self, way: Way, truth: Truth) -> Row:
        """The row of one way; steps are those of the gait's last cycle."""
        try:
            gait, work = work_of(lambda: self.find(way), self.repeats)
        except ArgumentError as error:
            return failed_row(way.name, way.setting, f"refused: {error}")
        found = gait.outcome is Search.FOUND
        return row_of(
            way.name,
            way.setting,
            OK if found else str(gait.outcome),
            truth,
            gait_values(gait),
            work,
            attempted=int(gait.solver_steps),
        )

    def find(self, way: Way) -> Gait:
        """The gait by one way: with its derivatives, but without the spectral radius's."""
        # Arrays, for one compiled program to serve every tolerance.
        rtol, tangent_rtol = np.asarray(way.rtol), np.asarray(TANGENT_SHARE * way.rtol)
        return find_gait(
            self.scene,
            parameters=self.parameters,
            accuracy=Precision(rtol, tangent_rtol),
            max_evaluations=_MOST_EVALUATIONS,  # and no stages beyond the first
            radius_sensitivities=False,
            solver=way.solver,
            engine=way.engine,
        )


def gait_values(gait: Gait) -> Values:
    """Period [s], absolute value of the largest multiplier, and the period's elasticities."""
    measures, slopes = jax.device_get((gait.measures, gait.elasticities.period))
    return {
        "period": np.atleast_1d(measures.period),
        "multiplier": np.atleast_1d(measures.spectral_radius),
        "gradient": np.atleast_1d(slopes),
    }
