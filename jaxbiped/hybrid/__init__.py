"""Hybrid systems: vector fields with guards, resets, endings and sections; walkers are some."""

from jaxbiped.hybrid._compliant_guards import switches as switches
from jaxbiped.hybrid._guards import Gap as Gap
from jaxbiped.hybrid._guards import Guard as Guard
from jaxbiped.hybrid._guards import Switch as Switch
from jaxbiped.hybrid._hybrid_system import At as At
from jaxbiped.hybrid._hybrid_system import HybridSystem as HybridSystem
from jaxbiped.hybrid._linkage_system import Swinging as Swinging
from jaxbiped.hybrid._rolling_system import Rolling as Rolling
from jaxbiped.hybrid._sections import AbstractSection as AbstractSection
from jaxbiped.hybrid._system import AbstractSystem as AbstractSystem
from jaxbiped.hybrid._walker_systems import RedundantWalking as RedundantWalking
from jaxbiped.hybrid._walker_systems import Walking as Walking
