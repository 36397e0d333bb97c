"""Orbit of a bouncing mass, against closed forms of multiplier, measures and derivatives."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.hybrid import Switch
from tests.systems import Plain, map_of, orbit_near

HEIGHT, DRIFT = 0.3, 0.7
"""Height of the section [m], and what the cyclic coordinate gains of the squared speed [s/m]."""


class Numbers(NamedTuple):
    """Gravity; the ground's stiffness [1/s²], push [m/s²] and level [m]; and the paddle's: it makes
    `kick` + `keep` v − `curb` v² of the mass's speed v as it comes up through the section.
    """

    g: jax.Array
    k: jax.Array
    push: jax.Array
    level: jax.Array
    kick: jax.Array
    keep: jax.Array
    curb: jax.Array


class Trampoline(Plain):
    """A mass (x, y, v), in free flight above the ground; neither spring nor push take energy."""

    cyclic_coordinates = (0,)
    jumps: bool = eqx.field(static=True)

    def vector_field(self, t, y, args):
        depth = args.level - y[1]
        force = jnp.where(depth > 0.0, args.k * depth + args.push, 0.0)
        return DRIFT * y[2] * y[2], y[2], force - args.g

    def switches(self, args, y):
        return (Switch(y[1] - args.level, True, force_jumps=self.jumps),)

    def reset_map(self, args, y):
        x, height, speed = y
        return x, height, args.kick + args.keep * speed - args.curb * speed * speed

    def load(self, args, y):
        return None if self.jumps else args.k * jnp.maximum(args.level - y[1], 0.0)


SPRING = Numbers(9.8, 900.0, 0.0, 0.02, 1.0, 0.9, 0.1)
PUSH = SPRING._replace(k=0.0, push=60.0)
ABOVE = jb.Section(lambda args, y: y[1] - HEIGHT)


def times(n, v):
    """Duration of a cycle that begins upwards at the speed v: in flight, and on spring or push."""
    w = jnp.sqrt(v * v + 2 * n.g * (HEIGHT - n.level))
    if n.k == 0.0:
        return 2 * w / n.g + 2 * w / (n.push - n.g)
    root = jnp.sqrt(n.k)
    return 2 * w / n.g + (jnp.pi + 2 * jnp.arctan2(n.g, w * root)) / root


def gait(n):
    """Speed on the section, period, advance, peak and spectral radius of the cycle on springs."""
    loss = 1 - n.keep  # kick = loss v + curb v²
    v = (jnp.sqrt(loss**2 + 4 * n.curb * n.kick) - loss) / (2 * n.curb)
    square = v * v + 2 * n.g * (HEIGHT - n.level)
    peak = n.g + jnp.sqrt(n.g**2 + n.k * square)
    # ∫ v² dt is the area within the cycle: of parabolas above, of an ellipse's part below.
    reach, root = jnp.sqrt(n.g**2 + n.k * square) / n.k, jnp.sqrt(n.k)
    low = -jnp.arcsin(n.g / (n.k * reach))
    area = 2 * square**1.5 / (3 * n.g) + root * reach**2 * (jnp.pi / 2 - low - jnp.sin(2 * low) / 2)
    return jnp.stack([v, times(n, v), DRIFT * area, peak, n.keep - 2 * n.curb * v])


def test_an_orbit_with_its_multiplier_and_all_derivatives():
    """Energy is kept: what the switch adds to second derivatives must cancel."""
    active = (0, 1, 3, 4, 5, 6)
    spec = map_of(Trampoline(False), ABOVE, engine="lanes")
    guess = tuple(map(jnp.asarray, (0.0, HEIGHT, 2.0)))

    found = jax.jit(lambda args: orbit_near(spec, args, guess, active))(
        jax.tree.map(jnp.asarray, SPRING)
    )
    last, stability, slopes = found.found.last, found.stability, found.slopes
    ours = (found.state[2], last.period, last.advance[0], last.peak, stability.spectral_radius)
    np.testing.assert_allclose(ours, gait(SPRING), rtol=1e-7)
    assert stability.multipliers.shape == (1,)
    assert float(stability.unit_error) < 1e-6
    jacobian = jax.jacfwd(gait)(jax.tree.map(jnp.asarray, SPRING))
    expected = np.stack([jacobian[i] * SPRING[i] for i in active], axis=1)
    ours = (slopes.recurring[1], slopes.period, slopes.advance[0], slopes.peak, found.radius_slopes)
    np.testing.assert_allclose(np.stack(ours), expected, rtol=1e-5, atol=1e-6)


def back(n, v):
    """Speed above the paddle and time of a return that begins upwards at the speed v."""
    return jnp.stack([n.kick + n.keep * v - n.curb * v * v, times(n, v)])


def columns_of(n, names):
    """Derivatives of a return from 2 m/s, with respect to the speed and to logarithms."""
    by_args, by_speed = jax.jacfwd(back, argnums=(0, 1))(
        jax.tree.map(jnp.asarray, n), jnp.asarray(2.0)
    )
    columns = [by_speed, *(getattr(by_args, name) * getattr(n, name) for name in names)]
    return np.stack(columns, axis=1)


@pytest.mark.parametrize("tangent_rtol", [1e-6, 1e-9])
def test_steps_are_short_enough_for_the_tangents(tangent_rtol):
    """However loosely the state is solved."""
    names = ("k", "level")
    once = jb.gait.linearise_return_map(
        SPRING, (0.0, HEIGHT, 2.0), rtol=1e-4, tangent_rtol=tangent_rtol, parameters=names,
        section=ABOVE, system=Trampoline(False), engine="lanes",
    )  # fmt: skip
    ours = np.stack([once.jacobian[1, 1:], once.period_row[1:]])
    np.testing.assert_allclose(ours, columns_of(SPRING, names), rtol=0.0, atol=tangent_rtol)


@pytest.mark.parametrize("engine", ["lanes"])
def test_a_force_that_jumps_makes_tangents_jump(engine):
    names, start = ("g", "push", "level"), (0.0, HEIGHT, 2.0)
    once = jb.gait.linearise_return_map(
        PUSH, start, rtol=1e-9, tangent_rtol=1e-8, parameters=names, section=ABOVE,
        system=Trampoline(True), engine=engine,
    )  # fmt: skip

    np.testing.assert_allclose([once.recurring[1], once.period], back(PUSH, 2.0), rtol=1e-8)
    ours = np.stack([once.jacobian[1, 1:], once.period_row[1:]])
    np.testing.assert_allclose(ours, columns_of(PUSH, names), rtol=1e-6, atol=1e-7)
    assert int(once.jumps) == 2
