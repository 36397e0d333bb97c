"""Laws that are refused, against one sentence that begins with the argument and its value."""

import operator

import pytest

import jaxbiped as jb

WEIGHT = dict(mass=1.0, penetration=1e-3)
STEEL = dict(modulus=210e9, poisson=0.3, ground_modulus=1e9)
STRIBECK = dict(mu_static=0.5, mu_kinetic=0.4, v_s=1e-3)
BROWN = dict(mu_static=0.4, mu_dynamic=0.4, v_t=1.0)
NORMAL = dict(K=1e6, c=1e7, n=1.5, mass=2.0)
FRICTION = dict(mu_static=0.5, mu_kinetic=0.4, v0=1e-4, xi=1000.0)
IMPACT = dict(K=1e6, e=0.5, approach_speed=0.1)


@pytest.mark.parametrize(
    ("make", "numbers", "words"),
    [
        ("KelvinVoigt", dict(K=0.0, D=1.0), ("K", "0", "N/m")),
        ("KelvinVoigt", dict(K=1.0, D=-1.0), ("D", "-1")),
        ("KuwabaraKono", dict(K=-2.0, gamma=1.0), ("K", "-2")),
        ("KuwabaraKono", dict(K=1.0, gamma=-3.0), ("gamma", "-3")),
        ("Tsuji", dict(K=float("inf"), gamma=1.0), ("K", "inf")),
        ("Tsuji", dict(K=1.0, gamma="much"), ("gamma", "much", "number")),
        ("HuntCrossley", dict(K=1.0, hysteresis=-1.0), ("hysteresis", "-1", "s/m")),
        ("HuntCrossley", dict(K=1.0, hysteresis=1.0, n=0.9), ("n", "0.9", "at least")),
        (
            "HuntCrossley.from_restitution",
            IMPACT | dict(formula="newton"),
            ("formula", "newton", "flores"),
        ),
        (
            "HuntCrossley.from_restitution",
            IMPACT | dict(approach_speed=0.0),
            ("approach_speed", "0", "above 0"),
        ),
        ("HuntCrossley.from_restitution", IMPACT | dict(K=-1.0), ("K", "-1")),
        ("HuntCrossley.from_restitution", IMPACT | dict(e="soft"), ("e", "soft", "number")),
        ("HuntCrossley.from_restitution", IMPACT | dict(n=0.5), ("n", "0.5")),
        ("Hertz.from_weight", WEIGHT | dict(mass=0.0), ("mass", "0", "kg")),
        ("Hertz.from_weight", WEIGHT | dict(penetration=-1.0), ("penetration", "-1")),
        ("Hertz.from_weight", WEIGHT | dict(n=0.5), ("n", "0.5")),
        ("Tsuji.from_weight", WEIGHT | dict(damping_ratio=-0.1), ("damping_ratio", "-0.1")),
        ("Tsuji.from_weight", WEIGHT | dict(damping_ratio=0.1, g=0.0), ("g", "0", "m/s^2")),
        (
            "hertz_stiffness",
            STEEL | dict(radius=0.1, ground_poisson=0.6),
            ("ground_poisson", "0.6", "above -1", "at most 0.5"),
        ),
        (
            "hertz_stiffness",
            STEEL | dict(radius=0.0, ground_poisson=0.3),
            ("radius", "0", "above 0"),
        ),
        ("Viscous", dict(k=-1.0), ("k", "-1", "s/m")),
        ("Threlfall", dict(mu=-0.1, v0=1.0), ("mu", "-0.1")),
        ("Threlfall", dict(mu=0.1, v0=0.0), ("v0", "0", "m/s")),
        ("Ambrosio", dict(mu=-0.1, v0=1.0, v1=2.0), ("mu", "-0.1")),
        ("Ambrosio", dict(mu=0.1, v0=0.0, v1=2.0), ("v0", "0", "above 0")),
        ("Ambrosio", dict(mu=0.1, v0=2.0, v1=1.5), ("v1 − v0", "-0.5", "above 0")),
        ("Ambrosio", dict(mu=0.1, v0=2.0, v1="fast"), ("v1", "fast", "number")),
        ("Stribeck", STRIBECK | dict(p=0.0, k_v=0.0, v_d=1.0), ("p", "0")),
        ("Stribeck", STRIBECK | dict(p=1.0, k_v=-0.5, v_d=1.0), ("k_v", "-0.5")),
        ("Stribeck", STRIBECK | dict(p=1.0, k_v=0.0, v_d=-1.0), ("v_d", "-1")),
        ("Andersson", STRIBECK | dict(v_s=0.0, p=1.0, k=1.0), ("v_s", "0")),
        ("Andersson", STRIBECK | dict(p=1.0, k=float("nan")), ("k", "nan")),
        ("Andersson", STRIBECK | dict(mu_static=-1, p=1.0, k=1.0), ("mu_static", "-1")),
        ("BrownMcPhee", BROWN | dict(mu_static=0.3), ("mu_static", "0.3", "mu_dynamic = 0.4")),
        ("BrownMcPhee", BROWN | dict(mu_dynamic=-1.0), ("mu_dynamic", "-1")),
        ("BrownMcPhee", BROWN | dict(v_t=0.0), ("v_t", "0")),
        ("BrownMcPhee", BROWN | dict(mu_v=1.0), ("N_t", "None", "mu_v")),
        ("BrownMcPhee", BROWN | dict(mu_v=1.0, N_t=0.0), ("N_t", "0", "above 0")),
        ("Dahl", dict(mu=0.4, sigma_0=0.0), ("sigma_0", "0")),
        ("LuGre", STRIBECK | dict(v_s=-1.0, sigma_0=1e4, sigma_1=1.0), ("v_s", "-1")),
        ("normal_law_like", NORMAL | dict(name="rubber"), ("name", "rubber", "hunt-crossley")),
        ("normal_law_like", NORMAL | dict(name="tsuji", mass=-1.0), ("mass", "-1")),
        ("normal_law_like", NORMAL | dict(name="tsuji", mass="m"), ("mass", "number")),
        ("normal_law_like", NORMAL | dict(name="tsuji", g=0.0), ("g", "0", "above 0")),
        ("normal_law_like", NORMAL | dict(name="hertz", K=-1.0), ("K", "-1")),
        ("friction_law_like", FRICTION | dict(name="ice"), ("name", "ice", "brown-mcphee")),
        ("friction_law_like", FRICTION | dict(name="viscous", v0=0.0), ("v0", "0")),
        ("friction_law_like", FRICTION | dict(name="stribeck", xi=0.0), ("xi", "0")),
        ("friction_law_like", FRICTION | dict(name="lugre", xi=0.0), ("xi", "0")),
        ("friction_law_like", FRICTION | dict(name="dahl", mu_kinetic=0.0), ("mu", "0")),
        ("friction_law_like", FRICTION | dict(name="coulomb", mu_static=-1.0), ("mu_static",)),
    ],
)
def test_bad_arguments_are_named(make, numbers, words):
    with pytest.raises(jb.ArgumentError) as caught:
        operator.attrgetter(make)(jb.laws)(**numbers)
    assert str(caught.value).startswith(f"{words[0]} = ")
    assert all(word in str(caught.value) for word in words)
