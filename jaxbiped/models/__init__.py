"""Published walkers: functions that return the papers' walkers as ready scenes, and their table."""

from jaxbiped.models._catalogue import MODELS as MODELS
from jaxbiped.models._catalogue import Model as Model
from jaxbiped.models._compass_walkers import bhounsule as bhounsule
from jaxbiped.models._compass_walkers import garcia as garcia
from jaxbiped.models._compass_walkers import goswami as goswami
from jaxbiped.models._compass_walkers import kuo as kuo
from jaxbiped.models._compass_walkers import wisse as wisse
from jaxbiped.models._mcgeer import mcgeer as mcgeer
from jaxbiped.models._walkers_in_modes import hsu_chen as hsu_chen
from jaxbiped.models._walkers_in_modes import rimless_wheel as rimless_wheel
