"""The driven walker a second time: Lagrange's equations from the places of its masses alone.

Kinetic energy and forces are derivatives of where masses and feet are, taken by JAX; accelerations
are NumPy's solution of M v̇ + Ṁ v − ∂T/∂q = Q. Of the package only the numbers of scenes are used.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from tests.reference import friction_force, normal_force

LIGHT = 0.01
"""Share of the weight in the denominator of the loads' shares."""


def numbers_of(scene, **driving):
    """The numbers of a scene by short names; `driving` those of its actuators."""
    walker, ground = scene.walker, scene.ground
    p = {name: float(getattr(walker, name)) for name in ("m", "J", "l", "d", "r")}
    p |= {"hip": float(walker.hip_mass), "g": float(ground.g), "slope": float(ground.slope)}
    if scene.compliant:
        n, f = scene.normal, scene.friction
        p |= {"n": float(n.n), "K": float(n.K), "c": float(n.c), "v0": float(f.v0)}
        p |= {"mu_s": float(f.mu_static), "mu_k": float(f.mu_kinetic), "xi": float(f.xi)}
    return p | driving


def _hip(q, p):
    """Place of the hip: a coordinate, or over a foot that rolls."""
    if len(q) == 4:
        return q[:2]
    reach = p["l"] - p["r"]
    return jnp.stack([-p["r"] * q[1] - reach * jnp.sin(q[1]), p["r"] + reach * jnp.cos(q[1])])


def _along_leg(q, p, distance):
    """Places so far below the hip on both legs, shape (2, 2)."""
    legs = jnp.stack([jnp.sin(q[-2:]), -jnp.cos(q[-2:])], axis=1)
    return _hip(q, p) + distance * legs


def _kinetic(q, v, p):
    def speed_square(place):
        velocity = jax.jvp(place, (q,), (v,))[1]
        return jnp.sum(velocity**2)

    masses = p["m"] * speed_square(lambda q: _along_leg(q, p, p["d"]))
    hip = p["hip"] * speed_square(lambda q: _hip(q, p))
    return 0.5 * (masses + hip + p["J"] * jnp.sum(v[-2:] ** 2))


def _potential(q, p):
    up = jnp.array([-jnp.sin(p["slope"]), jnp.cos(p["slope"])])
    moment = p["m"] * jnp.sum(_along_leg(q, p, p["d"]), axis=0) + p["hip"] * _hip(q, p)
    return p["g"] * moment @ up


@jax.jit
def _parts(q, v, p):
    """Mass matrix, force that needs no contact, rows and places of the feet's centres."""
    momentum = jax.grad(_kinetic, argnums=1)
    mass = jax.jacfwd(momentum, argnums=1)(q, v, p)
    drift = jax.jvp(lambda q: momentum(q, v, p), (q,), (v,))[1]
    force = jax.grad(_kinetic)(q, v, p) - jax.grad(_potential)(q, p) - drift
    centres = functools.partial(_along_leg, p=p, distance=p["l"] - p["r"])
    return mass, force, jax.jacfwd(centres)(q), centres(q)


def accelerations(q, v, p, torques, preload=None):
    """Accelerations of q = (hip x, hip z, θ1, θ2), or (θ1, θ2) where leg 2 rolls.

    `torques(angles, rates, shares)` are those of the actuators on both legs, with each leg's share
    of the load; `preload(angle, rate)` a foot's extension and its rate.
    """
    mass, force, rows, centres = map(np.array, _parts(jnp.asarray(q), jnp.asarray(v), p))
    angles, rates = q[-2:], v[-2:]
    shares = np.array([0.0, 1.0])
    if len(q) == 4:
        loads = np.zeros(2)
        for k in range(2):
            extension, speed = preload(angles[k], rates[k]) if preload else (0.0, 0.0)
            depth, depth_rate = p["r"] - centres[k, 1] + extension, speed - rows[k, 1] @ v
            loads[k] = normal_force(depth, depth_rate, p) if rates[k] < 0.0 else 0.0
            friction = friction_force(loads[k], rows[k, 0] @ v + p["r"] * rates[k], p)
            force += rows[k, 1] * loads[k] + rows[k, 0] * friction
            force[2 + k] += p["r"] * friction
        weight = p["g"] * (2.0 * p["m"] + p["hip"])
        shares = loads / (loads.sum() + LIGHT * weight)
    force[-2:] += torques(angles, rates, shares)
    return np.linalg.solve(mass, force)


def derivative(_, y, p, torques, preload=None):
    """Time derivative of (q, v)."""
    q, v = np.split(np.asarray(y), 2)
    return np.concatenate([v, accelerations(q, v, p, torques, preload)])
