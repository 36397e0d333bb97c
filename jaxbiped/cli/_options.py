"""Options of commands: what a field's type says of it is checked, its default is a signature's."""

import dataclasses
import inspect
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, NamedTuple, dataclass_transform, get_args

from tyro.conf import OmitArgPrefixes, arg
from tyro.constructors import PrimitiveConstructorSpec

from jaxbiped._checks import (
    ArgumentError,
    check_choice,
    check_count,
    check_not_negative,
    check_positive,
)
from jaxbiped._files import check_writable_directory, check_writable_file
from jaxbiped._quantity import si_number
from jaxbiped.cli._declarations import Argument, documentation, names, signature

_UNIT = re.compile(r"\[(.+?)\]")


class Check(NamedTuple):
    """In the type of a field: what its value must pass, called with the option's name and it."""

    value: Callable[[str, Any], object]
    each: bool = False
    """Whether it is meant for every entry of a tuple."""


class Field(NamedTuple):
    """A field that is made, not written: its type and its default."""

    kind: Any
    default: Any


@dataclass_transform(kw_only_default=True, frozen_default=True)
class Options:
    """Options of a command, or a group of them: a subclass is a frozen dataclass.

    Args:
        of: public functions. A field without a default has that of their first argument of its
            name, and what is said of it there for help, unless its type or its docstring has some.
        made: further fields.
    """

    def __init_subclass__(
        cls, of: tuple[str, ...] = (), made: Mapping[str, Field] | None = None
    ) -> None:
        known: dict[str, Argument] = {}
        for function in reversed(of):
            known |= signature(function)
        own = inspect.get_annotations(cls)
        said = documentation(cls.__module__, cls.__name__) if own else {}
        for name, kind in own.items():
            group = get_args(kind)[0] if get_args(kind) else kind
            if isinstance(group, type) and issubclass(group, Options):
                # Its flags bear their names alone; tyro would look long for what is said of it.
                own[name] = Annotated[kind, OmitArgPrefixes, arg(help=group.__doc__)]
                setattr(cls, name, dataclasses.field(default_factory=group))
                continue
            if name in known and not hasattr(cls, name):
                setattr(cls, name, known[name].default)
                said.setdefault(name, known[name].help)
            if not any(getattr(each, "help", None) for each in _said_by(kind)):
                own[name] = Annotated[kind, arg(help=said[name])]
        for name, field in (made or {}).items():
            own[name] = field.kind
            setattr(cls, name, field.default)
        for name, kind in own.items():
            (words,) = (entry.help for entry in _said_by(kind) if getattr(entry, "help", None))
            if get_args(kind)[0] in (float, float | None) and (unit := _UNIT.search(words)):
                own[name] = Annotated[kind, _number_in(unit[1])]
        cls.__annotations__ = own
        dataclasses.dataclass(frozen=True, kw_only=True, eq=False, repr=False)(cls)

    def arguments(self, function: str) -> dict[str, Any]:
        """The options that are keywords of a public function by their names."""
        return {name: value for name, value in vars(self).items() if name in signature(function)}

    def check_names(self, scene: Any) -> None:
        """Raises `ArgumentError` for names that no scene of these options has."""

    def check(self) -> None:
        """Raises `ArgumentError` for what is wrong in itself, before anything slow is imported."""
        both = [name for name in ("json", "csv") if str(getattr(self, name, None)) == "-"]
        if len(both) > 1:
            raise ArgumentError("--json - and --csv - both print: give one of them a file.")
        for field in dataclasses.fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            if isinstance(value, Options):
                value.check()
            for said in _said_by(field.type) if value is not None else ():
                if isinstance(said, Check):
                    name = _name(field.name, field.type)
                    for entry in value if said.each else (value,):
                        said.value(name, entry)


def _number_in(unit: str) -> Any:
    """Reads a number in an SI unit, which may be written with its own: 0.03, 2deg, 500ms."""

    def read(texts: list[str]) -> float | None:
        return None if texts == ["None"] else si_number(texts[0], unit)

    return PrimitiveConstructorSpec(
        1, "FLOAT", read, lambda value: True, lambda value: [str(value)]
    )


def _said_by(kind: Any) -> tuple[Any, ...]:
    """What a type, or what it is made of, is annotated with."""
    inner = get_args(kind)
    if hasattr(kind, "__metadata__"):
        return (*_said_by(inner[0]), *kind.__metadata__)
    return tuple(said for each in inner for said in _said_by(each))


def _name(name: str, kind: Any) -> str:
    """The name by which an option is given."""
    own = (getattr(each, "name", None) for each in _said_by(kind))
    return next(filter(None, own), name)


class Command(Options):
    """A command with its options."""

    def check(self) -> None:
        """Raises `ArgumentError` for what is wrong in itself, and for names that no scene has."""
        super().check()
        groups = vars(self)
        for group in (*groups.values(), self) if "scene" in groups else ():
            if isinstance(group, Options):
                group.check_names(groups["scene"])

    def run(self) -> int:
        """Runs it; returns the exit code."""
        raise NotImplementedError


def interrupted(kept: str) -> KeyboardInterrupt:
    """An interrupt that a command passes on after it has written its results up to there."""
    error = KeyboardInterrupt()
    error.add_note(f"Interrupted: {kept}.")
    return error


def one_of(registry: str) -> Check:
    """Whether a name is in a public tuple or table."""
    return Check(lambda name, value: check_choice(name, value, names(registry)))


def among(*allowed: object) -> Check:
    """Whether a name or a number is one of these."""
    return Check(lambda name, value: check_choice(name, value, allowed))


def positive(unit: str = "") -> Check:
    """Whether a number is finite and above 0."""
    return Check(lambda name, value: check_positive(name, value, unit))


def accuracy_told(text: str) -> str | float:
    """An accuracy as it was told: a number where it is one, else a name."""
    try:
        return float(text)
    except ValueError:
        return text


def _check_accuracy(name: str, text: str) -> None:
    """Raises `ArgumentError` unless it names an accuracy or is a relative error above 0."""
    accuracy = accuracy_told(text)
    if isinstance(accuracy, str):
        check_choice(name, accuracy, (*names("ACCURACIES"), "a relative error above 0"))
    else:
        check_positive(name, accuracy)


Count = Annotated[int, Check(check_count)]
NotNegative = Annotated[int, Check(check_not_negative)]
AnyAccuracy = Annotated[str, Check(_check_accuracy)]
Accuracy = Annotated[
    AnyAccuracy,
    arg(help="Accuracy of the solve: draft, balanced or tight; or a relative error, such as 1e-4."),
]
GaitAccuracy = Annotated[
    str, arg(help="Accuracy of the solve: balanced or tight."), one_of("ACCURACIES")
]
"""Of a gait with derivatives."""
Engine = Annotated[
    str,
    arg(help="Engine: xla, lanes, cuda, or auto (the faster one that supports the request)."),
    one_of("ENGINES"),
]
CycleFootsteps = Annotated[
    int | None, Check(check_count), arg(help="Number of footsteps in a cycle.")
]
JsonPath = Annotated[
    Path | None,
    Check(lambda name, path: str(path) == "-" or check_writable_file(f"--{name}", path)),
]
Numbers = Annotated[
    JsonPath, arg(help="File for the numbers in SI units; - prints only the numbers.")
]
Rows = Annotated[
    JsonPath, arg(help="File for the table (CSV), units in its header; - prints only the table.")
]


class OutputOptions(Options):
    """Where results are written."""

    out: Path | None = None
    """Folder for figures and data."""
    format: Annotated[tuple[str, ...], one_of("plot.FIGURE_FORMATS")._replace(each=True)] = ("png",)
    """Formats of the figures: png, pdf, svg."""
    style: Annotated[str, one_of("plot.FIGURE_STYLES")] = "screen"
    """Style of the figures: screen, or paper, with small letters and as wide as its columns."""
    columns: Annotated[int, among(1, 2)] = 1
    """Number of columns of a paper that a figure spans: 1 or 2."""
    json: Numbers = None
    csv: Rows = None

    def make_folder(self) -> None:
        """Makes the folder, where one is asked for; raises where it cannot be written."""
        if self.out is not None:
            check_writable_directory("--out", self.out)

    def draw(self, figures: Mapping[str, Callable[[], Any]]) -> list[Path]:
        """Draws figures by the names of their files, and writes them; returns the paths.

        None is drawn where no folder is asked for.
        """
        if self.out is None:
            return []  # importing what draws takes half a second
        import jaxbiped as jb

        paths = list[Path]()
        with jb.plot.figure_style(self.style, columns=self.columns):
            for name, draw in figures.items():
                paths += jb.plot.save_figure(draw(), self.out / name, formats=self.format)
        return paths
