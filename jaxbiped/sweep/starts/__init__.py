"""Starts of a sweep: grids, samples, given states, and the coordinates in which they differ."""

from jaxbiped.sweep.starts._coordinates import coordinate_names as coordinate_names
from jaxbiped.sweep.starts._coordinates import coordinate_quantities as coordinate_quantities
from jaxbiped.sweep.starts._starts import SAMPLINGS as SAMPLINGS
from jaxbiped.sweep.starts._starts import AbstractStarts as AbstractStarts
from jaxbiped.sweep.starts._starts import GivenStarts as GivenStarts
from jaxbiped.sweep.starts._starts import Grid as Grid
from jaxbiped.sweep.starts._starts import Sample as Sample
from jaxbiped.sweep.starts._starts import grid as grid
from jaxbiped.sweep.starts._starts import sample as sample
