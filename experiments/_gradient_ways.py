"""Ways to differentiate a problem through contact, and their errors against its truth.

Each way prepares a function that gives the state at the end, its derivatives with respect to the
logarithms of the parameters, and what it says about their error (None where it says nothing).
"""

import importlib.util
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from matplotlib.axes import Axes

from jaxbiped.trade import work_of

KVAERNO5 = diffrax.Kvaerno5(root_finder=diffrax.with_stepsize_controller_tols(optx.Chord)())
TOLERANCES = (1e-4, 1e-6, 1e-8)

NOT_INSTALLED, OTHER_LAW = "not installed", "its contact has another law"
OVERFLOWED = "derivatives overflow"
PACKAGES = (
    "jaxbiped", "jax", "diffrax", "scipy", "casadi", "mujoco-mjx", "brax", "warp-lang", "newton",
)  # fmt: skip


class Answer(NamedTuple):
    """What a way says.

    Attributes:
        state: numbers at the end.
        gradient: a row for each of them, with respect to the inputs.
        said: its own estimate of the gradient's error, as `relative_error` measures; or None.
    """

    state: Any
    gradient: Any
    said: float | None = None


Run = Callable[[], Answer]


class Way(NamedTuple):
    """A tool and the settings at which it is asked.

    Attributes:
        name: a word for it.
        setting: what is varied.
        settings: its values, from rough to fine.
        prepare: from the problem, or its truth, and a setting to what answers.
        module: what must be installed beside this project's own requirements; "" for nothing.
        law: the problem that it solves, where its contact is not the problem's own.
    """

    name: str
    setting: str
    settings: tuple[float, ...]
    prepare: Callable[[Any, float], Run]
    module: str = ""
    law: Callable[[Any], Any] = lambda problem: problem

    @property
    def installed(self) -> bool:
        """Whether its module is there."""
        return not self.module or importlib.util.find_spec(self.module) is not None


def relative_error(rows: Any, truth: Any) -> float:
    """Largest difference of two gradients, relative to the largest entry of each row."""
    rows, truth = np.asarray(rows), np.asarray(truth)
    return float(np.max(np.abs(rows - truth) / np.max(np.abs(truth), axis=1, keepdims=True)))


def with_estimate(linearised: Callable[..., Answer], rtol: float) -> Run:
    """An answer that says the changes of its gradient by two witnesses together.

    One is by a ten times looser tolerance; the other by another method, and counts twice. A sum, as
    in the bars of gaits: either may agree by chance.
    """

    def run() -> Answer:
        fine, loose = linearised(rtol), linearised(10.0 * rtol)
        other = linearised(rtol, solver="rodas5p")
        first, second = (relative_error(each.gradient, fine.gradient) for each in (loose, other))
        return fine._replace(said=first + 2.0 * second)

    return run


def differentiate(outputs: Callable[[jax.Array], jax.Array], count: int) -> Run:
    """Numbers with their forward derivatives by so many changes of inputs, compiled once."""

    def twice(changes: jax.Array) -> tuple[jax.Array, jax.Array]:
        found = outputs(changes)
        return found, found

    program, zeros = jax.jit(jax.jacfwd(twice, has_aux=True)), jnp.zeros(count)
    return lambda: Answer(*map(np.asarray, jax.block_until_ready(program(zeros))[::-1]))


def diffrax_solution(
    field: Callable[..., Any], solver: diffrax.AbstractSolver, rtol: float, duration: float,
    start: Any, args: Any = None, **options: Any,
) -> diffrax.Solution:  # fmt: skip
    """The end of a motion through diffrax, differentiable forwards, as a user would write it."""
    steps = diffrax.PIDController(rtol=rtol, atol=1e-2 * rtol)
    how = dict(stepsize_controller=steps, adjoint=diffrax.ForwardMode(), max_steps=1 << 18)
    term = diffrax.ODETerm(field)
    return diffrax.diffeqsolve(term, solver, 0.0, duration, None, start, args, **how, **options)


def row_of(
    problem: str, way: Way, value: float, given: Any, truth: Any, *, repeats: int, least: float
) -> dict[str, Any]:
    """Errors of one way at one setting, and its time once compiled; or why there are none.

    Args:
        problem: its name.
        way, value: the way and its setting.
        given: what the way prepares its answer from.
        truth: with `state` and `gradient`.
        repeats: runs at most whose median time counts.
        least: size of a number of the state below which its error is not relative to it.
    """
    named = {"problem": problem, "way": way.name, "setting": way.setting, "value": value}
    if not way.installed:
        return named | {"outcome": NOT_INSTALLED}
    try:
        answer, work = work_of(way.prepare(given, value), repeats)
    except RuntimeError as error:
        return named | {"outcome": f"raised {type(error).__name__}"}
    spent = {"seconds": work.seconds, "cpu_s": work.cpu_s}
    scale = np.maximum(np.abs(truth.state), least)
    off = float(np.max(np.abs(np.asarray(answer.state) - truth.state) / scale))
    if not np.all(np.isfinite(answer.gradient)):
        return named | {"outcome": OVERFLOWED, "state_error": off} | spent
    error_of_gradient = relative_error(answer.gradient, truth.gradient)
    found = {"outcome": "answered", "state_error": off, "gradient_error": error_of_gradient}
    return named | found | {"said": answer.said} | spent


def draw_way(ax: Axes, name: str, rows: list[dict[str, Any]], **look: Any) -> None:
    """A way's errors of the gradient over those of the state, and what it says of them."""
    states, gradients = ([row[key] for row in rows] for key in ("state_error", "gradient_error"))
    (line,) = ax.loglog(states, gradients, "o-", label=name, **look)
    if rows[0]["said"] is not None:
        said = [row["said"] for row in rows]
        ax.loglog(states, said, "v:", color=line.get_color(), label=f"{name}: what it says")


def versions() -> dict[str, str | None]:
    """Versions of the tools that can be asked; None where one is not installed."""
    return {name: _version(name) for name in PACKAGES}


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
