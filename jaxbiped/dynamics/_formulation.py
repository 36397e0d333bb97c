"""Formulations: the state and the equations of motion that belong to a kind of scene.

A formulation registers its kind of scene here, so that a new one is a file of its own.
"""

import functools

from jaxtyping import PyTree

from jaxbiped._types import VectorField


@functools.singledispatch
def state_type(scene: object) -> type[PyTree]:
    """The type of a scene's states, a NamedTuple of scalar leaves."""
    raise TypeError(f"{type(scene).__name__} has no formulation.")


@functools.singledispatch
def field_of(scene: object) -> VectorField:
    """A scene's vector field f(t, state, scene), in the form that `diffrax.ODETerm` takes."""
    raise TypeError(f"{type(scene).__name__} has no formulation.")
