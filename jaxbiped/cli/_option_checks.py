"""Checks of options that need no scene: before JAX is imported."""

from jaxbiped._checks import check_choice, check_positive
from jaxbiped.cli._choices import ACCURACIES, ENGINES, GAIT_ACCURACIES


def check_engine(engine: str) -> None:
    """Raises `ArgumentError` unless it is the name of an engine."""
    check_choice("engine", engine, ENGINES)


def check_gait_accuracy(accuracy: str) -> None:
    """Raises `ArgumentError` unless it names an accuracy that derivatives can be asked for."""
    check_choice("accuracy", accuracy, GAIT_ACCURACIES)


def check_accuracy(accuracy: str | None) -> None:
    """Raises `ArgumentError` unless it names an accuracy or is a relative error above 0."""
    if accuracy is None:
        return
    try:
        number = float(accuracy)
    except ValueError:
        check_choice("accuracy", accuracy, (*ACCURACIES, "a relative error above 0"))
    else:
        check_positive("accuracy", number)
