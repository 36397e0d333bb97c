"""Analyses of basins of attraction from labels alone: fractions, boundaries, dimension, entropy."""

from jaxbiped.basins._boundary_dimension import Dimension as Dimension
from jaxbiped.basins._boundary_dimension import Uncertainty as Uncertainty
from jaxbiped.basins._boundary_dimension import boundary_dimension as boundary_dimension
from jaxbiped.basins._boundary_dimension import sampled_uncertainty as sampled_uncertainty
from jaxbiped.basins._boundary_dimension import uncertainty_exponent as uncertainty_exponent
from jaxbiped.basins._label_statistics import Entropy as Entropy
from jaxbiped.basins._label_statistics import Fraction as Fraction
from jaxbiped.basins._label_statistics import Fractions as Fractions
from jaxbiped.basins._label_statistics import entropy as entropy
from jaxbiped.basins._label_statistics import fractions as fractions
from jaxbiped.basins._label_statistics import wilson_interval as wilson_interval
from jaxbiped.basins._labels import Doubt as Doubt
from jaxbiped.basins._labels import Label as Label
from jaxbiped.basins._labels import LabelErrors as LabelErrors
from jaxbiped.basins._labels import label_errors as label_errors
from jaxbiped.basins._labels import label_name as label_name
from jaxbiped.basins._labels import label_names as label_names
from jaxbiped.basins._minimal_fatal_shock import FatalShock as FatalShock
from jaxbiped.basins._minimal_fatal_shock import minimal_fatal_shock as minimal_fatal_shock
from jaxbiped.basins._refined_boundary import RefinedBoundary as RefinedBoundary
from jaxbiped.basins._refined_boundary import refine_boundary as refine_boundary
