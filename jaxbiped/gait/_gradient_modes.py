"""Gradient modes: how a derivative is taken, and where."""

import equinox as eqx

from jaxbiped._checks import ArgumentError


class AbstractGradient(eqx.Module):
    """A way to take derivatives."""


class Forward(AbstractGradient):
    """Tangents carried along the motion, their errors controlled: for few directions.

    Through XLA every direction is one solve of its own under `jax.jacfwd`, in lockstep; by lanes
    all share one.
    """


class Reverse(AbstractGradient):
    """Reverse mode, for many parameters.

    Through XLA it goes back over the solver's steps, with checkpoints; they are chosen so that the
    derivatives with respect to the whole state keep the derivatives' tolerance, and reverse mode
    is those derivatives' transpose. By lanes the derivatives with respect to every input are
    carried along the motion, as `Forward` does, and transposed.
    """


class Implicit(AbstractGradient):
    """The implicit function theorem at a periodic orbit: every derivative, once, for both modes.

    First derivatives only: a second one is refused.
    """


def check_anywhere(gradient: AbstractGradient, what: str) -> None:
    """Raises `ArgumentError` for a mode that needs a periodic orbit."""
    if not isinstance(gradient, AbstractGradient):
        raise ArgumentError(
            f"gradient = {gradient!r} is not allowed: it must be Forward() or Reverse()."
        )
    if isinstance(gradient, Implicit):
        raise ArgumentError(
            f"gradient = {type(gradient).__name__}() is not allowed for {what}, which need not be "
            "periodic: choose Forward() or Reverse()."
        )
