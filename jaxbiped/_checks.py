"""Checks of arguments: one clear sentence each, raised before anything is compiled.

Values that are being traced (inside `jit`, `vmap`, `grad`) have no number to check and pass; what
would be refused is noted for those who ask (`traced_rules`). JAX is not imported for a check, nor
NumPy before one: the command line refuses without them.
"""

import contextlib
import errno
import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import ArrayLike

_Test: TypeAlias = "Callable[[Any], Any]"


class ArgumentError(ValueError):
    """An argument is not allowed. The message names it, its value and what is allowed."""


class ResourceError(RuntimeError):
    """What computes or stores has failed, such as a full disk or lost workers; no argument has.

    The same call works once that is mended.
    """


_WRONG_PATH = ("EACCES", "EPERM", "EROFS", "ENOENT", "EEXIST", "ENOTDIR", "EISDIR", "ENAMETOOLONG")
"""Errors of a file system where another path would do; any other is the disk's own."""


def failure_kind(error: OSError) -> type[ArgumentError] | type[ResourceError]:
    """Whether a path that cannot be written is to blame itself, or what it lies on."""
    wrong = errno.errorcode.get(error.errno or 0) in _WRONG_PATH
    return ArgumentError if wrong else ResourceError


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


def _shown(array: "np.ndarray", bad: "np.ndarray") -> str:
    """The first offending value; where there are many, how many offend."""
    first = f"{array[bad].flat[0]:g}"
    return first if array.size == 1 else f"{first} (one of {int(bad.sum())} such entries)"


_RULES: ContextVar["list[ArrayLike] | None"] = ContextVar("rules", default=None)


@contextlib.contextmanager
def traced_rules() -> "Iterator[list[ArrayLike]]":
    """Gathers, of all that is checked within and traced, whether it is allowed (booleans).

    A door puts NaN where one of them does not hold, so that this lane fails and no other does.
    Doors within doors gather for both.
    """
    rules: list[ArrayLike] = []
    outer, token = _RULES.get(), _RULES.set(rules)
    try:
        yield rules
    finally:
        _RULES.reset(token)
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
    if not array.ndim and np.isfinite(one := array.item()) and test(one):
        return  # the quick way for what is asked of every number at every door
    bad = ~(np.isfinite(array) & test(array))
    if bad.any():
        raise ArgumentError(f"{name} = {_shown(array, bad)} is not allowed: it must be {allowed}.")


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


def check_positive(name: str, value: object, unit: str = "") -> None:
    """Raises `ArgumentError` unless every entry of `value` is finite and above zero."""
    _require(name, value, f"a finite number above 0{_in(unit)}", lambda x: x > 0)


def check_not_negative(name: str, value: object, unit: str = "") -> None:
    """Raises `ArgumentError` unless every entry of `value` is finite and at least zero."""
    _require(name, value, f"a finite number of at least 0{_in(unit)}", lambda x: x >= 0)


def check_count(name: str, value: "ArrayLike") -> None:
    """Raises `ArgumentError` unless `value` is one whole number above zero, known beforehand."""
    import numpy as np

    allowed = "a whole number above 0"
    if _is_traced(value) or np.ndim(value):
        shown = "a traced value" if _is_traced(value) else f"an array of shape {np.shape(value)}"
        raise ArgumentError(f"{name} = {shown} is not allowed: it must be {allowed}.")
    _require(name, value, allowed, lambda x: (x > 0) & (x == np.floor(x)))


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
            raise ArgumentError(
                f"{full} has the shape {np.shape(leaf)}: give {one}, and use jax.vmap for many."
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


def check_below(name: str, value: object, bound: float, why: str) -> None:
    """Raises `ArgumentError` unless |value| < bound in every entry."""
    _require(name, value, f"between {-bound:g} and {bound:g} ({why})", lambda x: abs(x) < bound)


def check_within(
    name: str, value: object, lower: float, upper: float, *, open_below: bool = False
) -> None:
    """Raises `ArgumentError` unless lower <= value <= upper (`open_below`: lower < value)."""
    allowed = f"{'above' if open_below else 'at least'} {lower:g} and at most {upper:g}"
    _require(
        name,
        value,
        allowed,
        lambda x: (x > lower if open_below else x >= lower) & (x <= upper),
    )


def check_choice(name: str, value: object, allowed: Iterable[object]) -> None:
    """Raises `ArgumentError` unless `value` is one of the `allowed` names or numbers."""
    names = list(allowed)
    if value not in names:
        raise ArgumentError(
            f"{name} = {value!r} is not known: choose one of {', '.join(map(str, names))}."
        )


def check_type(name: str, value: object, *kinds: type) -> None:
    """Raises `ArgumentError` unless `value` is an instance of one of `kinds`."""
    if not isinstance(value, kinds):
        allowed = " or a ".join(kind.__name__ for kind in kinds)
        raise ArgumentError(f"{name} = {value!r} is not allowed: it must be a {allowed}.")


def user_path(path: str | Path) -> Path:
    """A path as the user means it: "~" is the home folder.

    Raises:
        ArgumentError: no path, or a home folder that is not known.
    """
    try:
        return Path(path).expanduser()
    except (TypeError, RuntimeError) as error:
        raise ArgumentError(f"path = {path!r} is not allowed: {error}.") from None


def read_json(name: str, path: str | Path) -> Any:
    """What a JSON file holds; raises `ArgumentError` for one that cannot be read or is no JSON."""
    try:
        return json.loads(user_path(path).read_text())
    except OSError as error:
        reason = (error.strerror or "unreadable").lower()
        raise ArgumentError(f"{name} = {str(path)!r} cannot be read ({reason}).") from None
    except ValueError as error:
        raise ArgumentError(f"{name} = {str(path)!r} is not JSON ({error}).") from None


def check_writable_directory(name: str, path: Path) -> None:
    """Creates the directory if need be; raises where files cannot be written.

    Raises:
        ArgumentError: the path is not allowed.
        ResourceError: its disk is full or fails.
    """
    allowed = "it must be a directory in which files can be written"
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = (error.strerror or "cannot be made").lower()
        raise failure_kind(error)(
            f"{name} = {str(path)!r} is not allowed ({reason}): {allowed}."
        ) from None
    if not os.access(path, os.W_OK | os.X_OK):
        raise ArgumentError(f"{name} = {str(path)!r} is not allowed (not writable): {allowed}.")


def check_writable_file(name: str, path: Path) -> None:
    """Raises `ArgumentError` where a file of this name cannot be written."""
    if path.is_dir():
        raise ArgumentError(f"{name} = {str(path)!r} is a directory: it must be a file to write.")
    parent = path.parent
    if not parent.is_dir() or not os.access(path if path.exists() else parent, os.W_OK):
        raise ArgumentError(
            f"{name} = {str(path)!r} cannot be written: its folder must exist and be writable."
        )


def _in(unit: str) -> str:
    return f" {unit}" if unit else ""
