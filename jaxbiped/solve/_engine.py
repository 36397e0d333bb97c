"""Engines by name, and which of them "auto" stands for."""

import jax

from jaxbiped._checks import ArgumentError, check_choice

ENGINES = ("auto", "xla", "lanes")
"""Names of the engines.

- xla: diffrax, compiled by XLA: on every device, for every solver, in every mode of
  differentiation.
- lanes: the same method compiled to vector code for this machine's CPU: many times faster.
- auto: lanes where JAX computes on a CPU and they can do what is asked, else xla. `simulate` keeps
  to xla inside `jit`, `vmap` and derivatives, for it is not known what will be asked of it there.
"""


def engine_for(engine: str, *, obstacle: str | None, prefers_xla: bool = False) -> str:
    """The engine to use.

    Args:
        engine: one of `ENGINES`.
        obstacle: why lanes cannot do what is asked; None where they can.
        prefers_xla: whether "auto" is "xla" here all the same.

    Raises:
        ArgumentError: an unknown name, or lanes for what they cannot do.
    """
    check_choice("engine", engine, ENGINES)
    if engine == "lanes" and obstacle is not None:
        raise ArgumentError(f'engine = "lanes" is not allowed here: {obstacle}; use engine="xla".')
    if engine != "auto":
        return engine
    able = obstacle is None and jax.default_backend() == "cpu"
    return "lanes" if able and not prefers_xla else "xla"
