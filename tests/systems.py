"""Systems of a few coordinates that tests make: what they need not say, and their orbits."""

import jax.numpy as jnp

import jaxbiped as jb
from jaxbiped.gait._fixed_point_search import FixedPointProblem, search
from jaxbiped.gait._newton import Method
from jaxbiped.gait._orbit_derivatives import orbit_of, with_parameter_columns
from jaxbiped.gait._return_map_spec import ReturnMapSpec
from jaxbiped.solve._accuracy import precision_of


class Plain(jb.hybrid.AbstractSystem):
    """Without switches, endings or load; nothing is done to the state at an arrival."""

    def switches(self, args, y):
        return ()

    def ending(self, args, y):
        return jnp.asarray(0)

    def reset_map(self, args, y):
        return y

    def load(self, args, y):
        return None


def map_of(system, section, *, steps=1, engine="xla"):
    """The return map of a system, for `orbit_near`; a return takes 20 s at most."""
    return ReturnMapSpec(system, section, jb.solvers.Rodas4(), 20.0, steps, 32768, engine)


def orbit_near(spec, args, guess, active=(0,)):
    """The orbit near a guess, with derivatives with respect to the active numbers of its args."""
    tight = precision_of("tight")
    problem = FixedPointProblem(spec, args, (), guess, tight, Method(None, 40, 1e-10))
    asked = problem._replace(active=active)
    return orbit_of(asked, with_parameter_columns(asked, search(problem)), radius=True)
