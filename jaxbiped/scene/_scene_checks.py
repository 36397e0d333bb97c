"""Check of a scene at a public function's door, by the rules of its parts' constructors.

Values that `equinox.tree_at` or `vmap` put in have passed no constructor.
"""

from collections.abc import Iterator
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import ArrayLike

from jaxbiped._checks import ArgumentError, check_type, is_number, traced_rules
from jaxbiped._jax_versions import undifferentiated
from jaxbiped._types import SomeTree, as_float, is_real, is_traced
from jaxbiped.caching._cached_jit import cached_jit, note_code
from jaxbiped.caching._caches import OfObjects, OncePerVersion


def check_scene(scene: Any, *kinds: type[Any]) -> Any:
    """A scene of one of these kinds with all its numbers in 64 bits, each as its part allows.

    Raises:
        ArgumentError: another kind, or a number that is not allowed. A traced scene that has one is
            NaN throughout instead, in that lane.
    """
    check_type("scene", scene, *kinds)
    note_code(scene)
    leaves, structure = jtu.tree_flatten(scene)
    exact = [_in_64_bits(leaf) for leaf in leaves]
    if any(a is not b for a, b in zip(leaves, exact, strict=True)):
        scene = jtu.tree_unflatten(structure, exact)
    plain = jtu.tree_map(undifferentiated, scene) if is_traced(exact) else scene
    if is_traced(jtu.tree_leaves(plain)):
        with traced_rules() as rules:
            _check_parts(scene)
        return where_allowed(rules, scene)
    # Within a caller's trace, too, what is computed of known numbers is known.
    with jax.ensure_compile_time_eval():
        _, once = _CHECKED(plain, lambda: OncePerVersion(structure))()
        once(lambda: _check_parts(plain))
    return scene


_CHECKED = OfObjects[OncePerVersion[None]]()


def _check_parts(scene: Any) -> None:
    for part in _parts(scene):
        for kind in reversed(type(part).__mro__):
            if "__check_init__" in vars(kind):
                kind.__check_init__(part)  # type: ignore[attr-defined]


def where_allowed(
    rules: list[ArrayLike], tree: SomeTree, otherwise: float | None = None
) -> SomeTree:
    """The tree, its numbers others where one of the rules (see `traced_rules`) does not hold.

    None: NaN, and so are their derivatives.
    """
    return _kept(rules, tree, otherwise) if rules and jtu.tree_leaves(tree) else tree


@cached_jit  # many small operations
def _kept(rules: list[ArrayLike], tree: SomeTree, otherwise: float | None) -> SomeTree:
    kept = jnp.all(jnp.stack(rules))
    if otherwise is not None:
        return jtu.tree_map(lambda leaf: jnp.where(kept, leaf, otherwise), tree)
    factor = jnp.where(kept, 1.0, jnp.nan)  # a selection has a derivative of 0
    return jtu.tree_map(lambda leaf: leaf * factor if is_real(leaf) else leaf, tree)


def _in_64_bits(leaf: Any) -> Any:
    if isinstance(leaf, jax.core.Tracer):
        return as_float(leaf).astype(float)
    if isinstance(leaf, jax.Array) and leaf.dtype == jnp.float64 and not leaf.weak_type:
        return leaf
    if not is_number(leaf):
        raise ArgumentError(f"scene holds {leaf!r}, which is not a number.")
    return as_float(leaf).astype(float)


def _parts(tree: Any) -> Iterator[eqx.Module]:
    """The modules that a scene is made of, each after its own parts, itself last."""
    inside: Any = ()
    if isinstance(tree, eqx.Module):
        inside = vars(tree).values()
    elif isinstance(tree, list | tuple):
        inside = tree
    elif isinstance(tree, dict):
        inside = tree.values()
    for each in inside:
        yield from _parts(each)
    if isinstance(tree, eqx.Module):
        yield tree
