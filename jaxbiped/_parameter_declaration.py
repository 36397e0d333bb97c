"""Parameters: numeric fields that carry their words, symbol, unit and allowed range.

Checks, the command line, figures and datasets read these, so that a law of the user's own says
what its parameters are in the one place where it declares them. Parts of a scene are made of them.
"""

import dataclasses
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, ClassVar

import equinox as eqx

from jaxbiped._checks import ArgumentError
from jaxbiped._quantity import ParameterInfo, Quantity
from jaxbiped._summary import in_short
from jaxbiped._types import Parameter, Scalar, as_float

_KEY = "parameter"


def parameter(
    words: str,
    symbol: str = "",
    unit: str = "",
    *,
    positive: bool = False,
    minimum: float | None = None,
    size_below: float | None = None,
    several: bool = False,
    default: Parameter | None = dataclasses.MISSING,
) -> Any:
    """A field for a parameter of a law of contact or of any other part of a scene.

    Values are converted to floating-point arrays. Laws of contact, and every other class that calls
    `check_parameters`, refuse a value that is not finite or not in the range.

    Args:
        words: name of the parameter in tables and figures, such as "contact stiffness".
        symbol: mathematical symbol in matplotlib's notation, such as "$K$".
        unit: SI unit, such as "N s/m^2". An exponent may be the name of a parameter, as in "N/m^n".
            Empty for a pure number.
        positive: whether the value must be above 0.
        minimum: smallest allowed value; None for no limit.
        size_below: upper limit of the absolute value, not itself allowed; None for no limit.
        several: whether the parameter is a tuple of numbers, such as a point or the coefficients of
            a spline.
        default: default value. If None is the default, None is kept, and the law works without the
            parameter.

    Example:
        A law of one's own begins so::

            class Sticky(jaxbiped.laws.AbstractFrictionLaw):
                grip: float = jaxbiped.laws.parameter("grip", "$G$", "s/m", minimum=0.0)

    Returns:
        The field, for the body of an `equinox.Module`; it converts its values to floating-point
        arrays.
    """
    one = _optional_float if default is None else as_float
    info = ParameterInfo(Quantity(words, symbol, unit), positive, minimum, size_below)
    given: dict[str, Any] = {} if default is dataclasses.MISSING else {"default": default}
    return eqx.field(converter=_tuple if several else one, metadata={_KEY: info}, **given)


def parameter_infos(part: Any) -> dict[str, ParameterInfo]:
    """What the fields of a part of a scene (or of its class) carry, plain fields left out."""
    fields = dataclasses.fields(part)
    return {field.name: field.metadata[_KEY] for field in fields if _KEY in field.metadata}


def check_parameters(part: object) -> None:
    """Raises `ArgumentError` for the first parameter of a part that is not allowed."""
    infos = parameter_infos(part)
    for field in dataclasses.fields(part):  # type: ignore[arg-type]
        value = getattr(part, field.name)
        if field.name in infos and (value is not None or field.default is not None):
            for entry in value if isinstance(value, tuple) else (value,):
                infos[field.name].check(field.name, entry)


def _optional_float(value: Parameter | None) -> Scalar | None:
    return None if value is None else as_float(value)


def _tuple(values: Parameter | Iterable[Parameter]) -> tuple[Scalar, ...]:
    one = not isinstance(values, Iterable) or getattr(values, "ndim", 1) == 0
    return tuple(map(as_float, [values] if one else values))


def with_fields(piece: Any, **fields: object) -> Any:
    """A piece with other fields, unchecked."""
    # Not by `copy.copy`: equinox would hold the new one for ever, as one that is being made.
    changed = object.__new__(type(piece))
    for name, value in (vars(piece) | fields).items():
        object.__setattr__(changed, name, value)
    return changed


class AbstractPart(eqx.Module):
    """A part of a scene, whose parameters are checked when it is made."""

    __repr__ = in_short

    def __check_init__(self) -> None:
        check_parameters(self)


class AbstractNamedPart(AbstractPart):
    """A part that enters the catalogue of its kind as its class is defined, a user's own too.

    Attributes:
        name: what the catalogue and the command line call it; None for one that is in none. A
            property of the class.
        catalogue: the classes of its kind by name. A property of the class.
        needed: what a class with a name has besides. A property of the class.

    Raises:
        ArgumentError: where a class with a name is defined: a name that another class has, or a
            class that lacks what is needed.
    """

    name: ClassVar[str | None] = None
    catalogue: ClassVar[dict[str, Any]] = {}
    needed: ClassVar[tuple[str, ...]] = ()

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...  # a scene's law has parameters of its own

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        name = vars(cls).get("name")
        if name is None:
            return
        for lacking in (each for each in cls.needed if not hasattr(cls, each)):
            raise ArgumentError(f"{cls.__qualname__} is not allowed to have a name: no {lacking}.")
        known = cls.catalogue.setdefault(name, cls)
        if (known.__module__, known.__qualname__) != (cls.__module__, cls.__qualname__):
            raise ArgumentError(f"name = {name!r} is not allowed: {known.__qualname__} has it.")
        cls.catalogue[name] = cls  # defined anew, as in a notebook
