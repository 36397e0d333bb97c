"""Labels of starts: labellings and their gaits, a labelling as a function, the nearest failure."""

from jaxbiped.sweep._attractor import Attractor as Attractor
from jaxbiped.sweep._gait_family import Family as Family
from jaxbiped.sweep._label_recorders import Labelled as Labelled
from jaxbiped.sweep._labelling import Labelling as Labelling
from jaxbiped.sweep._labelling_preparation import label_at as label_at
from jaxbiped.sweep._labelling_preparation import with_gaits_met as with_gaits_met
from jaxbiped.sweep._nearest_failure import nearest_failure as nearest_failure
