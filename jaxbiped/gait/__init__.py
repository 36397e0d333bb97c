"""Periodic gaits: search, return map, stability, sensitivities, continuation."""

from jaxbiped.gait._find_gait import Gaits as Gaits
from jaxbiped.gait._fixed_point_search import Search as Search
from jaxbiped.gait._gait import Measures as Measures
from jaxbiped.gait._orbit_derivatives import Slopes as Slopes
from jaxbiped.gait._orbit_derivatives import slopes_of as slopes_of
from jaxbiped.gait._poincare_map import LinearisedReturn as LinearisedReturn
from jaxbiped.gait._return_map import Return as Return
from jaxbiped.gait._return_map import linearise_return_map as linearise_return_map
from jaxbiped.gait._return_map_spec import AbstractGradient as AbstractGradient
from jaxbiped.gait._return_map_spec import Forward as Forward
from jaxbiped.gait._return_map_spec import Implicit as Implicit
from jaxbiped.gait._return_map_spec import Reverse as Reverse
from jaxbiped.gait._search_provenance import BranchEnd as BranchEnd
from jaxbiped.gait._search_provenance import FoundBy as FoundBy
from jaxbiped.gait._search_provenance import Origin as Origin
from jaxbiped.gait._search_provenance import OtherGait as OtherGait
from jaxbiped.gait._search_provenance import explain_search as explain_search
from jaxbiped.gait._search_starts import rolling_starts as rolling_starts
from jaxbiped.gait._stability import Bifurcation as Bifurcation
from jaxbiped.gait._stability import Stability as Stability
from jaxbiped.gait._stability import stability_of as stability_of
