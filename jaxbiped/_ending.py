"""Endings of a simulation, by name: codes that simulations and labels share."""

import enum


class NamedCode(enum.IntEnum):
    """A code with a name. `str(code)` is the name in words."""

    def __str__(self) -> str:
        return self.name.lower().replace("_", " ")


class Ending(NamedCode):
    """How a simulation ended. `str(ending)` is its name in words.

    - walking: the time or the footsteps asked for are done.
    - fell forward: the hip came down moving downhill; or the swing leg turned back too late, its
      foot ahead but so deep under the ground that the reaction bars its way.
    - fell back: the hip came down moving uphill.
    - stopped: the stance leg came to rest in single support (under the paper's clearance rule it
      would then lose its ground and sink), or the whole walker stands still on the ground.
    - stumbled: the foot behind came down, moving forward, while the one ahead carried; or the
      swing leg was so barred before it had passed the other.
    - out of steps: the solver's cap on steps was reached.
    - solver failed: the state is no longer a number.
    - timed out: no footstep, or no arrival at a section, came in all the time allowed for it.
    - finished: the time asked for is done, of a linkage, which does not walk.
    """

    WALKING = 0
    FELL_FORWARD = 1
    FELL_BACK = 2
    STOPPED = 3
    STUMBLED = 4
    OUT_OF_STEPS = 5
    SOLVER_FAILED = 6
    TIMED_OUT = 9  # 7 and 8 are labels that no single simulation ends with
    FINISHED = 10
