"""jaxbiped: differentiable simulation of passive biped walkers in JAX.

This page is the map. What a first session needs is here; the rest lies in namespaces by subject.
`jaxbiped/__init__.py` reads it: a name is imported from where its line says when it is first used.
"""

# Namespaces.
from jaxbiped import basins as basins
from jaxbiped import constraints as constraints
from jaxbiped import continuation as continuation
from jaxbiped import dynamics as dynamics
from jaxbiped import gait as gait
from jaxbiped import hybrid as hybrid
from jaxbiped import identify as identify
from jaxbiped import measure as measure
from jaxbiped import models as models
from jaxbiped import optimise as optimise
from jaxbiped import plot as plot
from jaxbiped.scene import actuation as actuation
from jaxbiped.scene import laws as laws
from jaxbiped.solve import solvers as solvers
from jaxbiped.sweep import labels as labels
from jaxbiped.sweep import starts as starts

# Memory.
from jaxbiped.caching._caches import cache_info as cache_info
from jaxbiped.caching._caches import clear_caches as clear_caches

# Files of scenes and results.
from jaxbiped._saving import load as load
from jaxbiped._saving import save as save

# What is modelled.
from jaxbiped.scene._bodies import Body as Body
from jaxbiped.scene._bodies import Foot as Foot
from jaxbiped.scene._ground import Ground as Ground
from jaxbiped.scene._joint_parts import Coupling as Coupling
from jaxbiped.scene._joint_parts import Latch as Latch
from jaxbiped.scene._joint_parts import Motor as Motor
from jaxbiped.scene._joint_parts import Spring as Spring
from jaxbiped.scene._joint_parts import Stop as Stop
from jaxbiped.scene._walker import Kneed as Kneed
from jaxbiped.scene._mechanism import Mechanism as Mechanism
from jaxbiped.scene._ready_scenes import ladder as ladder
from jaxbiped.scene._parameter_access import parameter_names as parameter_names
from jaxbiped.scene._parameter_access import parameter_quantities as parameter_quantities
from jaxbiped.scene._parameter_access import parameter_values as parameter_values
from jaxbiped.scene._parameter_access import with_parameters as with_parameters
from jaxbiped.scene._scene import RedundantScene as RedundantScene
from jaxbiped.scene._scene import RigidScene as RigidScene
from jaxbiped.scene._scene import Scene as Scene
from jaxbiped.scene._ready_scenes import seed_scene as seed_scene
from jaxbiped.scene._walker import WithTorso as WithTorso
from jaxbiped.scene._walker import Walker as Walker

# States and the sections that they cross.
from jaxbiped.hybrid._sections import HeelStrike as HeelStrike
from jaxbiped.hybrid._sections import MidStance as MidStance
from jaxbiped.hybrid._sections import Section as Section
from jaxbiped.scene._state_types import State as State
from jaxbiped.dynamics._state import seed_state as seed_state

# Simulation.
from jaxbiped._checks import ArgumentError as ArgumentError
from jaxbiped._checks import ResourceError as ResourceError
from jaxbiped.simulate._simulate import rigid_walk as rigid_walk
from jaxbiped.simulate._simulation import CompiledSimulation as CompiledSimulation
from jaxbiped.simulate._simulation import Simulation as Simulation
from jaxbiped.simulate._simulate import simulate as simulate
from jaxbiped.simulate._simulate import swing as swing
from jaxbiped.solve._accuracy import ACCURACIES as ACCURACIES
from jaxbiped._ending import Ending as Ending
from jaxbiped.solve._engine_names import ENGINES as ENGINES
from jaxbiped.simulate._trajectory import Trajectory as Trajectory

# Measures of a walk.
from jaxbiped.measure._footsteps import footsteps as footsteps

# Periodic gaits and gradients.
from jaxbiped.gait._find_gait import find_gait as find_gait
from jaxbiped.gait._find_gait import find_gaits as find_gaits
from jaxbiped.gait._gait import Gait as Gait
from jaxbiped.gait._gait_measures import gait_measures as gait_measures
from jaxbiped.gait._return_map import return_map as return_map

# Branches of gaits.
from jaxbiped.continuation._continue_gait import continue_gait as continue_gait

# Identification.
from jaxbiped.identify._fit_gait import fit_gait as fit_gait

# Basins and sweeps.
from jaxbiped.sweep._workers import cluster_executor as cluster_executor
from jaxbiped.sweep._workers import local_executor as local_executor
from jaxbiped.sweep._gait_sweep import gait_sweep as gait_sweep
from jaxbiped.sweep._labelling_preparation import labelling as labelling
from jaxbiped.sweep._sweep import sweep as sweep

# Optimisation.
from jaxbiped.optimise._optimise_gait import optimise_gait as optimise_gait

__version__: str
