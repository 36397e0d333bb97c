"""Way of solving: a method, the engine that runs it, and its tolerance."""

from typing import NamedTuple


class Way(NamedTuple):
    """A way of solving at one setting.

    Attributes:
        solver: a name in `SOLVERS`.
        engine: "lanes" or "xla".
        setting: what a user would write for the tolerance, such as "tight" or "rtol=1e-8".
        rtol: the relative tolerance that it stands for.
    """

    solver: str
    engine: str
    setting: str
    rtol: float

    @property
    def name(self) -> str:
        """Method and engine, without the setting."""
        return f"{self.solver} by {self.engine}"
