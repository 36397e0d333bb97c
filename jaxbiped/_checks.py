"""Checks of arguments: one clear sentence each, raised before anything is compiled.

Values that are being traced (inside `jit`, `vmap`, `grad`) have no number to check and pass; what
would be refused is noted for those who ask (`traced_rules`). JAX is not imported for a check, nor
NumPy before one: the command line refuses without them.
"""

import contextlib
import operator
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import ArrayLike

LIBRARIES = frozenset(
    ("diffrax", "equinox", "jax", "jaxbiped", "jaxlib", "jaxtyping", "lineax", "llvmlite")
).union(("ml_dtypes", "numpy", "optax", "optimistix"), sys.stdlib_module_names)
"""Packages whose code is not the user's."""
MOST_ROOM = 1 << 27
"""States that may be kept of one simulation: some ten gigabytes."""
_T = TypeVar("_T")
_Test: TypeAlias = "Callable[[Any], Any]"


class ArgumentError(ValueError):
    """An argument is not allowed. The message names it, its value and what is allowed."""


class ResourceError(RuntimeError):
    """A resource has failed, such as a full disk or lost workers; the arguments are valid.

    The same call works once the cause is removed.
    """


def warn(sentence: str, category: type[Warning] = RuntimeWarning) -> None:
    """Warns at the line of the caller's code that called the package, or made a module of it.

    Between the two may lie Python's library (decorators, threads) and the package's libraries.
    """
    frame = sys._getframe(1)
    while frame.f_back and frame.f_globals.get("__name__", "").split(".")[0] in LIBRARIES:
        frame = frame.f_back
    names = frame.f_globals
    place = frame.f_code.co_filename, frame.f_lineno, names.get("__name__")
    registry = names.setdefault("__warningregistry__", {})
    warnings.warn_explicit(sentence, category, *place, registry)


def is_number(value: object) -> bool:
    """Whether a value may stand for a number or many; texts and truth values may not."""
    if hasattr(value, "dtype"):
        import jax
        import numpy as np

        return bool(jax.dtypes.issubdtype(value.dtype, np.number))  # type: ignore[attr-defined]
    if isinstance(value, list | tuple):
        return all(map(is_number, value))
    return value is not None and not isinstance(value, str | bytes | bool)


def _is_traced(value: object) -> bool:
    jax: Any = sys.modules.get("jax")  # where it is not imported, nothing is traced
    return jax is not None and isinstance(value, jax.core.Tracer)


def _numbers(name: str, value: object) -> "np.ndarray":
    import numpy as np

    try:
        if not is_number(value):
            raise ValueError
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise ArgumentError(f"{name} = {value!r} is not a number.") from None


_RULES: ContextVar["list[ArrayLike] | None"] = ContextVar("rules", default=None)


@contextlib.contextmanager
def gathered(variable: "ContextVar[list[_T] | None]") -> "Iterator[list[_T]]":
    """A new list that the variable holds within."""
    found: list[_T] = []
    token = variable.set(found)
    try:
        yield found
    finally:
        variable.reset(token)


@contextlib.contextmanager
def traced_rules() -> "Iterator[list[ArrayLike]]":
    """Gathers, of all that is checked within and traced, whether it is allowed (booleans).

    A door puts NaN where one of them does not hold, so that this lane fails and no other does.
    Doors within doors gather for both.
    """
    outer = _RULES.get()
    with gathered(_RULES) as rules:
        try:
            yield rules
        finally:
            if outer is not None:
                outer.extend(rules)


def _note(holds: "Callable[[], ArrayLike]") -> None:
    if (rules := _RULES.get()) is not None:
        rules.append(holds())


def _require(name: str, value: object, allowed: str, test: _Test) -> None:
    if _is_traced(value):
        import jax.numpy as jnp

        _note(lambda: jnp.all(jnp.isfinite(value) & test(value)))  # type: ignore[arg-type]
        return
    import numpy as np

    array = _numbers(name, value)
    if not array.ndim and np.isfinite(one := array.item()) and np.all(test(one)):
        return  # the quick way for what is asked of every number at every door
    bad = ~(np.isfinite(array) & test(array))
    if bad.any():
        shown = f"{np.broadcast_to(array, bad.shape)[bad].flat[0]:g}"
        if bad.size > 1:
            shown += f" (one of {int(bad.sum())} such entries)"
        raise ArgumentError(f"{name} = {shown} is not allowed: it must be {allowed}.")


def holds_somewhere(condition: "ArrayLike") -> bool:
    """Whether a condition that must not hold is known to, in any entry.

    What is being traced is not known, and noted.
    """
    import numpy as np

    if _is_traced(condition):
        _note(lambda: ~condition.any())  # type: ignore[union-attr]
        return False
    return bool(np.any(np.asarray(condition)))


def are_zero_together(one: "ArrayLike", other: "ArrayLike") -> bool:
    """Whether two numbers that must not both be zero are known to be, in any entry."""
    import numpy as np

    if _is_traced(one) or _is_traced(other):
        return holds_somewhere((one == 0.0) & (other == 0.0))
    return bool(np.any((np.asarray(one) == 0.0) & (np.asarray(other) == 0.0)))


def check_finite(name: str, value: object) -> None:
    """Raises `ArgumentError` unless every entry of `value` is a finite number."""
    _require(name, value, "a finite number", lambda x: x == x)


def check_positive(name: str, value: object, unit: str = "", *, one: bool = False) -> None:
    """Raises `ArgumentError` unless every entry of `value`, or its `one`, is finite and above 0."""
    if one:
        check_unbatched(name, value)
    _require(name, value, f"a finite number above 0 {unit}".rstrip(), lambda x: x > 0)


def check_not_negative(name: str, value: object, unit: str = "") -> None:
    """Raises `ArgumentError` unless every entry of `value` is finite and at least zero."""
    _require(name, value, f"a finite number of at least 0 {unit}".rstrip(), lambda x: x >= 0)


def check_count(name: str, value: "ArrayLike", least: int = 1) -> int:
    """One whole number of at least so much, known beforehand; raises `ArgumentError` for others."""
    import numpy as np

    allowed = "a whole number " + ("above 0" if least == 1 else f"of at least {least}")
    if value is None:
        raise ArgumentError(f"{name} = None is not allowed: it must be {allowed}.")
    if _is_traced(value) or np.ndim(value):
        shown = "a traced value" if _is_traced(value) else f"an array of shape {np.shape(value)}"
        raise ArgumentError(f"{name} = {shown} is not allowed: it must be {allowed}.")
    _require(name, value, allowed, lambda x: (x >= least) & (x == np.floor(x)))
    return int(np.asarray(value))


def check_room(name: str, value: "ArrayLike") -> None:
    """Raises `ArgumentError` unless `value` is a count of states that memory may have room for."""
    check_count(name, value)
    _require(name, value, f"at most {MOST_ROOM}", lambda x: x <= MOST_ROOM)


def check_unbatched(name: str, value: object, one: str = "one number") -> None:
    """Raises `ArgumentError` where any leaf of `value` is an array instead of one number."""
    import jax
    import numpy as np

    def is_array(x: object) -> bool:
        return type(x) is list or (x is value and type(x) is tuple)

    leaves = jax.tree_util.tree_flatten_with_path(value, is_leaf=is_array)
    for path, leaf in leaves[0]:
        if np.ndim(leaf):
            full = name + jax.tree_util.keystr(path)
            law = ", or for a law a tuple of numbers" if ".law." in full else ""
            raise ArgumentError(
                f"{full} has the shape {np.shape(leaf)}: give {one}, and use "
                f"jax.vmap for many{law}."
            )


def check_increasing(name: str, value: object, least: int) -> None:
    """Raises `ArgumentError` unless a list of at least so many finite numbers never decreases."""
    import numpy as np

    if _is_traced(value):
        return
    values = _numbers(name, value)
    known = values.ndim == 1 and len(values) >= least and bool(np.all(np.isfinite(values)))
    if not known or np.any(np.diff(values) < 0.0):
        raise ArgumentError(
            f"{name} = {np.array2string(values, threshold=8)} is not allowed: it must be a list of "
            f"{least} or more increasing numbers."
        )


def check_at_least(name: str, value: object, bound_name: str, bound: object) -> None:
    """Raises `ArgumentError` unless `value >= bound` in every entry.

    `bound_name` is the argument that sets the bound, or the bound itself in words.
    """
    if _is_traced(bound):
        _note(lambda: (value >= bound).all())  # type: ignore[operator]
    else:
        floor = _numbers(bound_name, bound)
        allowed = f"at least {bound_name}"
        if floor.size == 1 and bound_name.isidentifier():
            allowed += f" = {floor.item():g}"
        _require(name, value, allowed, lambda x: x >= floor)


def check_pair(name: str, value: object, smaller_name: str, smaller: object) -> None:
    """`check_at_least` of two arguments, either of which may be the one that is meant."""
    try:
        check_at_least(name, value, smaller_name, smaller)
    except ArgumentError:
        raise ArgumentError(
            f"{name} = {_numbers(name, value)} and {smaller_name} = "
            f"{_numbers(smaller_name, smaller)} are not allowed together: {name} must be at least "
            f"{smaller_name}."
        ) from None


def check_below(name: str, value: object, bound: float, why: str) -> None:
    """Raises `ArgumentError` unless |value| < bound in every entry."""
    _require(name, value, f"between {-bound:g} and {bound:g} ({why})", lambda x: abs(x) < bound)


def check_within(
    name: str, value: object, lower: float, upper: float, *, open_below: bool = False
) -> None:
    """Raises `ArgumentError` unless lower <= value <= upper (`open_below`: lower < value)."""
    allowed = f"{'above' if open_below else 'at least'} {lower:g} and at most {upper:g}"
    above = operator.gt if open_below else operator.ge
    _require(name, value, allowed, lambda x: above(x, lower) & (x <= upper))


def check_choice(name: str, value: object, allowed: Iterable[object]) -> None:
    """Raises `ArgumentError` unless `value` is one of the `allowed` names or numbers."""
    names = list(allowed)
    try:
        known = value in names
    except ValueError:  # an array, compared entry by entry
        known = False
    if not known:
        raise ArgumentError(
            f"{name} = {value!r} is not known: choose one of {', '.join(map(str, names))}"
            f"{near_miss(value, names)}."
        )


def near_miss(value: object, names: Iterable[object]) -> str:
    """Words that ask whether the nearest of some names was meant; none where none is near."""
    import difflib

    near = difflib.get_close_matches(str(value), map(str, names), 1)
    return f" (perhaps {near[0]} is meant)" if near else ""


def check_function(name: str, value: object) -> None:
    """Raises `ArgumentError` unless `value` can be called."""
    if not callable(value):
        raise ArgumentError(f"{name} = {value!r} is not allowed: it must be a function.")


def check_type(name: str, value: object, *kinds: type) -> None:
    """Raises `ArgumentError` unless `value` is an instance of one of `kinds`."""
    if not isinstance(value, kinds):
        names = [kind.__name__ for kind in kinds]
        allowed = " or ".join(f"{'an' if each[0] in 'AEIOU' else 'a'} {each}" for each in names)
        shown = repr(value)
        shown = shown if len(shown) < 80 else f"a {type(value).__name__}"
        raise ArgumentError(f"{name} = {shown} is not allowed: it must be {allowed}.")
