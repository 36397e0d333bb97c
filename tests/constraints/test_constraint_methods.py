"""Each method against its definition, written down with dense matrices."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb

N, COUNT = 7, 3
METHODS = {
    "standard": jb.constraints.Standard(),
    "baumgarte": jb.constraints.Baumgarte(a=3.0, b=7.0),
    "penalty": jb.constraints.Penalty(A=50.0, omega=6.0, zeta=0.7),
    "augmented": jb.constraints.Augmented(A=50.0, omega=6.0, zeta=0.7, iterations=4),
    "index1": jb.constraints.Index1(),
    "index1aug": jb.constraints.Index1Augmented(A=50.0, omega=6.0, zeta=0.7, iterations=4),
    "described": jb.constraints.DirectCorrection(),
}


@pytest.fixture(scope="module")
def system():
    """A random constrained system, as arrays and as the methods see it."""
    generator = np.random.default_rng(3)
    jacobian = generator.normal(size=(COUNT, N))
    jacobian[0, 2] = jacobian[1, 5] = 0.0
    known = dict(
        masses=generator.uniform(0.5, 2.0, N),
        applied=generator.normal(size=N),
        violation=generator.normal(size=COUNT),
        rate=generator.normal(size=COUNT),
        bias=generator.normal(size=COUNT),
    )
    rows = [{c: jnp.asarray(v) for c, v in enumerate(row) if v} for row in jacobian]
    lists = {name: list(map(jnp.asarray, values)) for name, values in known.items()}
    return jacobian, known, jb.constraints.Constrained(rows=rows, **lists)


def accelerations(method, system):
    multipliers = np.array(method.multipliers(system[2]))
    jacobian, known, _ = system
    return (known["applied"] - jacobian.T @ multipliers) / known["masses"]


def by_definition(name, system):
    """The formulas of the paper's section 4, in the form in which they are usually printed."""
    jacobian, known, _ = system
    mass, applied = np.diag(known["masses"]), known["applied"]
    gamma, off, rate = known["bias"], known["violation"], known["rate"]
    method = METHODS[name]
    if name in ("standard", "baumgarte", "index1", "described"):
        if name == "baumgarte":
            gamma = gamma - 2.0 * 3.0 * rate - 7.0**2 * off
        saddle = np.block([[mass, jacobian.T], [jacobian, np.zeros((COUNT, COUNT))]])
        return np.linalg.solve(saddle, np.concatenate([applied, gamma]))[:N]
    pull = 50.0 * jacobian.T @ (-gamma + 2.0 * 0.7 * 6.0 * rate + 36.0 * off)
    matrix = mass + 50.0 * jacobian.T @ jacobian
    if name == "penalty":
        return np.linalg.solve(matrix, applied - pull)
    found = applied / known["masses"]
    for _ in range(method.iterations):
        found = np.linalg.solve(matrix, mass @ found - pull)
    return found


@pytest.mark.parametrize("name", METHODS)
def test_accelerations_are_the_definitions(name, system):
    np.testing.assert_allclose(
        accelerations(METHODS[name], system), by_definition(name, system), rtol=1e-9, atol=1e-10
    )


@pytest.mark.parametrize("name", ["index1", "index1aug", "described"])
def test_corrections_are_the_definitions(name, system):
    jacobian, known, given = system
    method, residual = METHODS[name], known["violation"]
    moves = method.step_back(given.masses, given.rows, given.violation)
    weights = np.ones(N) if name == "described" else 1.0 / known["masses"]
    spread = weights[:, None] * jacobian.T
    if name == "index1aug":
        matrix = np.diag(known["masses"]) + 50.0 * jacobian.T @ jacobian
        expected = np.zeros(N)
        for _ in range(method.iterations):
            left = residual + jacobian @ expected
            expected = expected - 50.0 * np.linalg.solve(matrix, jacobian.T @ left)
    else:
        expected = -spread @ np.linalg.solve(jacobian @ spread, residual)
    np.testing.assert_allclose([float(moves[c]) for c in range(N)], expected, rtol=1e-10)


@pytest.mark.parametrize("name", jb.constraints.CONSTRAINT_METHODS)
def test_usual_constants_by_the_papers_name(name):
    scene = jb.RedundantScene(jb.seed_scene(), name)
    assert type(scene.method) is jb.constraints.CONSTRAINT_METHODS[name]


@pytest.mark.parametrize(
    ("build", "said"),
    [
        (lambda: jb.constraints.Baumgarte(a=-1.0), "a = -1 is not allowed"),
        (lambda: jb.constraints.Baumgarte(b=float("nan")), "b = nan is not allowed"),
        (lambda: jb.constraints.Penalty(A=0.0), "A = 0 is not allowed"),
        (lambda: jb.constraints.Augmented(omega=-2.0), "omega = -2 is not allowed"),
        (lambda: jb.constraints.Augmented(iterations=0), "iterations = 0 is not allowed"),
        (lambda: jb.constraints.Index1Augmented(zeta=float("inf")), "zeta = inf is not allowed"),
        (lambda: jb.constraints.Index1(iterations=0), "iterations = 0 is not allowed"),
        (lambda: jb.RedundantScene(jb.seed_scene(), "glue"), "method = 'glue' is not known"),
        (lambda: jb.RedundantScene(jb.seed_scene(), orientation="up"), "orientation = 'up'"),
        (lambda: jb.RedundantScene(jb.seed_state()), "scene = "),
        (lambda: jb.constraints.LinkBody(0.0, 1.0), "mass = 0 is not allowed"),
        (lambda: jb.constraints.Pin((0.0, 0.0), (0.0, 0.0), 1, 1), "body_2 = 1 is not allowed"),
        (
            lambda: jb.constraints.Linkage(
                (jb.constraints.LinkBody(1.0, 1.0),), (jb.constraints.Pin((0, 0), (0, 0), 3),)
            ),
            "joint = 3",
        ),
        (lambda: jb.constraints.Linkage((), ()), "bodies = ()"),
    ],
)
def test_what_is_not_allowed_is_one_sentence(build, said):
    with pytest.raises(jb.ArgumentError) as refused:
        build()
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("method", "name"),
    [
        (jb.constraints.Baumgarte, "a"),
        (jb.constraints.Baumgarte, "b"),
        (jb.constraints.Index1Augmented, "omega"),
        (jb.constraints.Index1Augmented, "zeta"),
        (jb.constraints.Augmented, "omega"),
        (jb.constraints.Augmented, "zeta"),
    ],
)
def test_zero_is_the_least_that_frequencies_and_damping_may_be(method, name):
    for value in (0.0, 0.5):
        assert float(getattr(method(**{name: value}), name)) == value
    with pytest.raises(jb.ArgumentError, match=f"{name} = -0.5 is not allowed"):
        method(**{name: -0.5})
