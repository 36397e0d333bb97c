"""A law of contact that lanes cannot express."""

import jax

import jaxbiped as jb


class ErrorFunction(jb.laws.AbstractFrictionLaw):
    """Of an operation that lanes do not have."""

    mu: float

    def force(self, normal_force, slip_speed):
        return -self.mu * normal_force * jax.scipy.special.erf(slip_speed / 1e-2)

    def switches(self, slip_speed):
        return ()
