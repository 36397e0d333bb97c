"""Environment variables that are numbers: their names, and what each may hold."""

import os
from collections.abc import Callable

from jaxbiped._checks import ArgumentError

CACHE_BYTES_VARIABLE = "JAXBIPED_CACHE_BYTES"
"""Bytes for records of simulations and for buffers; 0 to keep none."""
THREADS_VARIABLE = "JAXBIPED_THREADS"
"""Threads to use, else as many as the process has cores."""
VECTOR_VARIABLE = "JAXBIPED_VECTOR_BITS"
"""The bits of a vector where the CPU has as many or more."""


_ALLOWED: dict[str, tuple[str, Callable[[int], bool]]] = {
    CACHE_BYTES_VARIABLE: ("a whole number of bytes, 0 to keep none", lambda n: True),
    THREADS_VARIABLE: ("a whole number of threads above 0", lambda n: n > 0),
    VECTOR_VARIABLE: ("128, 256 or 512", (128, 256, 512).__contains__),
}


def environment_number(name: str) -> int | None:
    """The whole number that a variable holds, None where it is not set or empty.

    Raises:
        ArgumentError: it holds something else.
    """
    text, (allowed, test) = os.environ.get(name, "").strip(), _ALLOWED[name]
    if text and not (text.isdecimal() and test(int(text))):
        raise ArgumentError(f"{name} = {text!r} in the environment: it must be {allowed}.")
    return int(text) if text else None


def check_environment() -> None:
    """Raises `ArgumentError` for a variable that is not understood."""
    for name in _ALLOWED:
        environment_number(name)
