"""Published walkers: functions that return the papers' walkers as ready scenes, and their table."""

from jaxbiped.models._published_walkers import MODELS as MODELS
from jaxbiped.models._published_walkers import Model as Model
from jaxbiped.models._published_walkers import bhounsule as bhounsule
from jaxbiped.models._published_walkers import garcia as garcia
from jaxbiped.models._published_walkers import goswami as goswami
from jaxbiped.models._published_walkers import hsu_chen as hsu_chen
from jaxbiped.models._published_walkers import kuo as kuo
from jaxbiped.models._published_walkers import mcgeer as mcgeer
from jaxbiped.models._published_walkers import rimless_wheel as rimless_wheel
from jaxbiped.models._published_walkers import wisse as wisse
