"""Walkers of commands: named ones that walk as they are, and those of a user's own file."""

import functools
import importlib.util
import symtable
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import jaxbiped as jb
from jaxbiped._checks import ArgumentError
from jaxbiped.models import MODELS
from jaxbiped.models._published_walkers import knees

SEED = "seed"


class NamedWalker(NamedTuple):
    """A walker that commands know by a name.

    Attributes:
        words: what it is.
        make: makes it from the seed's walker.
        own_parameters: whether it has nothing of the seed's walker.
        start: scalars of the state that it starts with, its last leg standing; none for the seed's.
    """

    words: str
    make: Callable[[Any], Any]
    own_parameters: bool = False
    start: Mapping[str, float] = MappingProxyType({})


WALKERS: dict[str, NamedWalker] = {
    SEED: NamedWalker("two straight legs, the seed paper's", lambda walker: walker),
    "kneed": NamedWalker(
        "legs of thigh and shank with stops at the knees, McGeer's proportions",
        lambda _: jb.models.mcgeer(knees=True).walker,
        own_parameters=True,
        start=knees((0.10, -0.39, 0.06, 0.26), (2.63, 4.12, -0.99, -0.99)),
    ),
    "with-torso": NamedWalker(
        "the seed's legs and a torso that bisects the angle between them",
        lambda walker: jb.WithTorso(walker, m_torso=0.3, J_torso=0.0015, h=0.10),
        start={"theta_1": -0.281, "theta_2": 0.190, "omega_1": -0.036, "omega_2": -1.182},
    ),
}
for _name, _model in MODELS.items():
    _make = functools.partial(lambda model, _: model.make().walker, _model)
    WALKERS[_name] = NamedWalker(_model.words, _make, True, next(iter(_model.starts.values())))
"""By the name that --walker takes."""


def check_walker(option: str, told: str) -> None:
    """Raises `ArgumentError` for what is no known name, and no name in a file of Python."""
    if told in WALKERS:
        return
    path, name = _parts(option, told)
    try:
        source = path.read_text(encoding="utf-8")
        symbols = symtable.symtable(source, str(path), "exec").get_symbols()
    except (OSError, UnicodeDecodeError, SyntaxError) as error:
        raise ArgumentError(f"{option} = {told!r} cannot be read ({error}).") from None
    imported = {each.get_name() for each in symbols if each.is_imported()}
    bound = imported | {each.get_name() for each in symbols if each.is_assigned()}
    if name not in bound and "import *" not in source:
        known = ", ".join(sorted(bound - imported)) or "nothing"
        raise ArgumentError(
            f"{option} = {told!r} is not allowed: {path} does not define {name}; it defines "
            f"{known}."
        )


def usual_start(told: str) -> Mapping[str, float]:
    """Scalars of the state that a named walker starts with; none for any other."""
    return WALKERS[told].start if told in WALKERS else {}


def walker_of(option: str, told: str, seed: Any) -> Any:
    """The walker that an option names; `seed` is the seed's walker with its parameters.

    Raises:
        ArgumentError: a file that cannot be run, or what is no walker there.
    """
    if told in WALKERS:
        return WALKERS[told].make(seed)
    path, name = _parts(option, told)
    try:
        found = getattr(_module_of(path), name)
        if not _walks(found) and callable(found):
            found = found()
    except Exception as error:  # whatever the user's own code raises
        raise ArgumentError(
            f"{option} = {told!r} is not allowed: it raises {type(error).__name__}: {error}"
        ) from error
    if not _walks(found):
        raise ArgumentError(
            f"{option} = {told!r} is not allowed: it is {found!r}; give a Mechanism, a module "
            "with a method mechanism(), or a function without arguments that makes one."
        )
    return found


def _walks(found: Any) -> bool:
    has_method = hasattr(found, "mechanism") and not isinstance(found, type)
    return isinstance(found, jb.Mechanism) or has_method


def _parts(option: str, told: str) -> tuple[Path, str]:
    file, _, name = told.rpartition(":")
    if not file.endswith(".py") or not name.isidentifier():
        raise ArgumentError(
            f"{option} = {told!r} is not allowed: it must be one of {', '.join(WALKERS)}, or "
            "FILE.py:NAME."
        )
    return Path(file).expanduser(), name


def _module_of(path: Path) -> Any:
    """A file's module; what lies beside it can be imported there, as in a script."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    sys.path.insert(0, str(path.resolve().parent))
    spec.loader.exec_module(module)
    return module
