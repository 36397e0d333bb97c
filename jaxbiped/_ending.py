"""Endings of a simulation, by name: codes that simulations and labels share."""

import enum
from typing import Any, Self

from jaxbiped._checks import ArgumentError
from jaxbiped.caching._caches import PROGRAMS, bounded_cache


class NamedCode(enum.IntEnum):
    """A code with a name. `str(code)` is the name in words."""

    @classmethod
    def of(cls, code: Any) -> Self:
        """The name of one result's code.

        Raises:
            ArgumentError: the code is an array, of a batch, or a traced value.
        """
        try:
            return cls(int(code))
        except TypeError:  # JAX's of a traced value is one, too
            import numpy as np

            shape = np.shape(code)
            what = f"is an array of shape {shape}" if shape else "is a traced value"
            raise ArgumentError(
                f"only the code of one result has a name: this one {what}; compare it with numbers "
                f"such as {cls.__name__}.{next(iter(cls)).name}."
            ) from None

    def __str__(self) -> str:
        return self.name.lower().replace("_", " ")


class Ending(NamedCode):
    """How a simulation ended. `str(ending)` is its name in words.

    - walking: the requested time or number of footsteps was reached.
    - fell forward: the hip came down while moving downhill; or the swing leg turned back too late,
      with its foot ahead but so deep in the ground that the reaction blocks it.
    - fell back: the hip came down while moving uphill.
    - stopped: the stance leg came to rest in single support (under the paper's clearance rule, it
      would then lose contact and sink), or the whole walker stands still on the ground.
    - stumbled: the foot behind came down, moving forward, while the one ahead carried the load; or
      the ground blocked the swing leg in this way before it had passed the other leg.
    - out of steps: the maximum number of solver steps was reached.
    - solver failed: the state is no longer finite.
    - timed out: no footstep, or no arrival at a section, occurred within the allowed time.
    - finished: a linkage or a hybrid system, which does not walk, reached the requested time.
    - chatters: resets follow each other ever faster, or one leaves the state on its guard.
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
    CHATTERS = 11


FIRST_OF_A_SYSTEM = 100
"""Code of the first ending that a hybrid system names itself."""
_SHARED = (Ending.OUT_OF_STEPS, Ending.SOLVER_FAILED, Ending.TIMED_OUT, Ending.CHATTERS)


@bounded_cache(PROGRAMS)  # one class for one list of names
def endings_named(names: tuple[str, ...] | None) -> type[NamedCode]:
    """The endings of a hybrid system: those that any has, and those that it names.

    Reaching the requested time is its ending 0, "finished". None: those of a walker.
    """
    if names is None:
        return Ending
    members = {"FINISHED": 0} | {ending.name: int(ending) for ending in _SHARED}
    named = {name.upper().replace(" ", "_"): FIRST_OF_A_SYSTEM + k for k, name in enumerate(names)}
    made: Any = NamedCode
    kind: type[NamedCode] = made("Ending", members | named)
    return kind
