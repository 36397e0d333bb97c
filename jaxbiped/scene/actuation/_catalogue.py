"""Catalogue of the actuators by name."""

from collections.abc import Mapping
from types import MappingProxyType

from jaxbiped.scene import actuation
from jaxbiped.scene.actuation._abstract_actuator import AbstractActuator


def _by_name() -> Mapping[str, type[AbstractActuator]]:
    """The actuators that `jaxbiped.actuation` exports under a name, in the order of its lines."""
    classes = [each for each in vars(actuation).values() if isinstance(each, type)]
    found = [part for part in classes if issubclass(part, AbstractActuator)]
    return MappingProxyType({part.name: part for part in found if part.name is not None})


ACTUATORS: Mapping[str, type[AbstractActuator]] = _by_name()
"""Each actuator by name."""
