"""Numbers and rows of tables as the pages write them."""

UNKNOWN = "…"
"""Stands for what the results do not hold: the pages may say anything there."""


def small(number: float | None, digits: int = 1) -> str:
    """A number as the pages write it: 1.7e-3, 2.1e-1, 1.6."""
    if number is None:
        return UNKNOWN
    mantissa, exponent = f"{number:.{digits}e}".split("e")
    return mantissa if int(exponent) == 0 else f"{mantissa}e{int(exponent)}"


def row(*cells: str) -> str:
    """A row of a table."""
    return f"| {' | '.join(cells)} |"


def percents(number: float) -> str:
    """A fraction as the pages write it."""
    return f"{100.0 * number:.1f}"
