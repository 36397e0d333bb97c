"""Parts of a user's own, one of each kind, against the package's own that do the same."""

import dataclasses
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped import cli
from jaxbiped.cli import COMMANDS, Command
from jaxbiped.compiler import BY_NAME, XLA, AbstractEngine
from tests.saved_parts import Grip

SEED, START = jb.seed_scene(), jb.seed_state()
RIGID, ROLLING = jb.ladder()["rigid"], jb.dynamics.rigid_state(jb.seed_state())


@pytest.fixture(autouse=True)
def _catalogues_stay_as_they_were():
    catalogues = (
        jb.laws.NORMAL_LAWS, jb.laws.FRICTION_LAWS, jb.actuation.ACTUATORS,
        jb.constraints.CONSTRAINT_METHODS, jb.optimise.OBJECTIVES, jb.solvers.SOLVERS,
        BY_NAME, COMMANDS,
    )  # fmt: skip
    before = [dict(known) for known in catalogues]
    yield
    for known, old in zip(catalogues, before, strict=True):
        known.clear()
        known.update(old)


PENALTY = jb.constraints.Penalty(A=1e6)


def same(walk, other):
    assert int(walk.accepted) == int(other.accepted)
    assert jax.tree.all(jax.tree.map(np.array_equal, walk.final, other.final))


def short(scene, **options):
    return jb.simulate(scene, START, duration=0.02, save="end", **options)


def test_a_normal_law():
    class Spring(jb.laws.AbstractNormalLaw):
        """F_N = K δ: Kelvin and Voigt's without its damper."""

        name: ClassVar[str] = "spring"
        K: float = jb.laws.parameter("contact stiffness", "$K$", "N/m", positive=True)

        def force(self, penetration, rate):
            return self.elastic_force(penetration)

        def elastic_force(self, penetration):
            return jnp.where(penetration > 0.0, self.K * penetration, 0.0)

        def elastic_energy(self, penetration):
            return 0.5 * self.elastic_force(penetration) * penetration

        def switches(self, penetration, rate):
            return ()

        @classmethod
        def like_seed(cls, seed, standing):
            return cls(standing.mass * standing.g / standing.penetration)

    law = jb.laws.normal_law_like("spring")
    assert isinstance(law, Spring)
    theirs = jb.laws.KelvinVoigt(K=law.K, D=0.0)
    ends = [short(dataclasses.replace(SEED, normal=each)).final for each in (law, theirs)]
    np.testing.assert_allclose(*map(np.array, ends), rtol=1e-9, atol=1e-12)


def test_a_friction_law():
    class Named(Grip):
        """In the catalogue: `Viscous` by another name."""

        name: ClassVar[str] = "grip"

        @classmethod
        def like_seed(cls, seed):
            return cls(seed.mu_static / seed.v0)

    law = jb.laws.friction_law_like("grip")
    assert isinstance(law, Named)
    theirs = jb.laws.friction_law_like("viscous")
    same(*(short(dataclasses.replace(SEED, friction=each)) for each in (law, theirs)))
    with pytest.raises(jb.ArgumentError, match="name = 'viscous' is not allowed: Viscous has it"):
        type("Other", (Named,), {"name": "viscous"})
    with pytest.raises(jb.ArgumentError, match="Other is not allowed to have a name: no like_seed"):
        type("Other", (Grip,), {"name": "other"})
    assert jb.laws.FRICTION_LAWS["viscous"] is jb.laws.Viscous


def test_an_actuator():
    class Brake(jb.actuation.AbstractHipActuator):
        """A damper at the hip: `HipSpring`'s."""

        name: ClassVar[str] = "brake"
        b: float = jb.laws.parameter("damping", "$b$", "N m s/rad", minimum=0.0)

        def torques(self, hip):
            on_leg_1 = -self.b * (hip.rate[0] - hip.rate[1])
            return on_leg_1, -on_leg_1

        def motor_torques(self, hip):
            return None

        def idle(self):
            return dataclasses.replace(self, b=0.0 * self.b)

    assert jb.actuation.ACTUATORS["brake"] is Brake
    theirs = jb.actuation.HipSpring(k=0.0, b=0.02)
    scenes = [dataclasses.replace(SEED, actuation=part) for part in (Brake(0.02), theirs)]
    assert jb.parameter_names(scenes[0])[-1] == "b"
    ends = [short(scene).final for scene in scenes]
    np.testing.assert_allclose(*map(np.array, ends), rtol=1e-9, atol=1e-12)


def test_a_constraint_method():
    class Loose(jb.constraints.AbstractConstraintMethod):
        """The penalty's method, its own penalty."""

        needs_independent: ClassVar[bool] = False

        def multipliers(self, system):
            return PENALTY.multipliers(system)

    jb.constraints.CONSTRAINT_METHODS["loose"] = Loose
    scenes = (jb.RedundantScene(SEED, "loose"), jb.RedundantScene(SEED, PENALTY))
    start = jb.dynamics.redundant_state(scenes[0], START)
    moved = [jb.dynamics.redundant_motion(scene, start).accelerations for scene in scenes]
    np.testing.assert_allclose(*map(np.array, moved), rtol=1e-9)


def froude(scene, gait):
    """v²/(g l), with its derivatives."""
    speed, reach = float(gait.measures.speed), float(scene.ground.g * scene.walker.l)
    by_speed = 2.0 * speed / reach
    slopes = by_speed * np.asarray(gait.sensitivities.speed)
    for name in ("g", "l"):
        own = float(jb.parameter_values(scene)[name])
        slopes[jb.parameter_names(scene).index(name)] -= speed**2 / reach / own
    errors = gait.measure_errors.speed, np.asarray(gait.sensitivity_errors.speed)
    return speed**2 / reach, by_speed * errors[0], slopes, by_speed * errors[1]


@pytest.mark.slow
def test_an_objective():
    jb.optimise.OBJECTIVES["froude"] = jb.optimise.Objective(
        jb.laws.Quantity("Froude number", "$Fr$"), measured=froude
    )
    vary = {"d": (0.09, 0.11)}
    ours, theirs = (
        jb.optimise_gait(RIGID, vary=vary, maximise=name) for name in ("froude", "speed")
    )
    assert ours.variables["d"] == pytest.approx(theirs.variables["d"], rel=1e-6)
    assert ours.objective == pytest.approx(theirs.objective**2 / (9.8 * 0.4), rel=1e-6)


class Greet(Command):
    """Says so."""

    whom: str = "walker"
    """Whom to greet."""

    def run(self):
        print(f"Good morning, {self.whom}.")
        return 0


def test_a_command(capsys):
    COMMANDS["greet"] = Greet
    for arguments, said in (
        (["greet", "--whom", "leg"], "Good morning, leg."),
        (["greet", "--help"], "Whom to greet."),
        (["--help"], "Says so."),
    ):
        with pytest.raises(SystemExit) as ended:
            cli.main(arguments)
        assert not ended.value.code
        assert said in capsys.readouterr().out


def test_an_engine():
    class Counting(AbstractEngine):
        """XLA's, which counts what it runs."""

        runs = 0

        def can(self, request):
            return XLA.can(request)

        def run(self, request):
            self.runs += 1
            return XLA.run(request)

    own = BY_NAME["counting"] = Counting()
    same(*(
        jb.rigid_walk(RIGID, ROLLING, footsteps=2, engine=name) for name in ("counting", "xla")
    ))  # fmt: skip
    assert own.runs > 0
    with pytest.raises(jb.ArgumentError, match="engine = 'counting' is not allowed here"):
        jb.find_gait(RIGID, engine="counting")


def test_a_solver():
    class Mine(jb.solvers.AbstractRosenbrock):
        """The tableau of Rodas4."""

        tableau: ClassVar = jb.solvers.Rodas4.tableau

        def order(self, terms):
            return 4

    jb.solvers.SOLVERS["mine"] = Mine
    same(*(short(SEED, solver=name, engine="lanes") for name in ("mine", "rodas4")))
