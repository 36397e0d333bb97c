"""Branches of gaits, at their quick size, against bisection, differences and published gaits."""

import pytest

from tests.experiments.quick import drawn_run

pytestmark = pytest.mark.nightly


def test_the_cascade_and_the_walks_beside_it(tmp_path):
    numbers, _ = drawn_run("period_doubling", tmp_path)
    assert 0.1 < numbers["rigid_seed"]["slope"] < 0.102
    assert numbers["rigid_seed"]["doubled"]["footsteps"] == 2
    long, short = numbers["pair"]["long"], numbers["pair"]["short"]
    assert long["theta"] == pytest.approx(0.20031090049483, abs=1e-9)
    assert short["theta"] == pytest.approx(0.19393736960624, abs=1e-9)
    assert long["stable"]
    assert not short["stable"]
    assert long["first_doubling"] == pytest.approx(0.0150884379, abs=1e-9)
    assert numbers["cascade"]["footsteps"] == [1, 2, 4]
    assert numbers["cascade"]["ratios"] == pytest.approx([5.26], abs=0.01)
    chaos = numbers["chaos"]
    assert chaos["last_cycle"] < 0.0183 < chaos["first_without"] < 0.0189
    (family,) = numbers["period_three"]["branches"]
    assert "fold" in [kind for kind, _ in family["bifurcations"]]
    assert len(numbers["period_three"]["gaits"]) >= 1


def test_published_walkers_are_beside_what_was_printed(tmp_path):
    numbers, _ = drawn_run("published_walkers", tmp_path)
    rows = {(row["walker"], row["quantity"]): row["difference"] for row in numbers["rows"]}
    assert rows["garcia", "long gait: θ"] < 1e-12
    assert rows["bhounsule", "u1"] < 1e-12
    assert rows["goswami", "θ̇_s"] < 5e-5
    assert rows["garcia", "slope of doubling 1, rad"] < 5e-5
    assert set(numbers["periods"]) >= {"garcia, short", "mcgeer-kneed, gait", "wisse, gait"}


def test_stability_is_lost_where_bisection_says(tmp_path):
    numbers, figures = drawn_run("slope_branch", tmp_path, unitless={"parameter"})
    assert set(figures) == {
        "slope_branch.png", "bifurcation_elasticities.png", "k_c_xi_branches.png",
        "k_c_xi_curves.png",
    }  # fmt: skip
    compliant, rigid = numbers["scenes"]["stribeck"], numbers["scenes"]["rigid"]
    assert [row["kind"] for row in compliant["losses"]] == ["fold", "period-doubling"]
    assert [row["kind"] for row in rigid["losses"]] == ["period-doubling"]
    for row in (*compliant["losses"], *rigid["losses"]):
        assert abs(abs(complex(*row["multiplier"])) - 1.0) < 1e-6
        # Multipliers change by at most 50 for each rad; the bracket is of 5e-8 rad.
        assert row["off"] < 1e-7 + row["error"] / 25.0
    assert numbers["hundred_gaits"]["gaits"] >= 100
    # Elasticities of a critical slope are those of differences.
    found = numbers["cases"]["doubling, rigid"]
    assert found["slope_rad"] == pytest.approx(0.100401149, abs=1e-8)
    row = found["parameters"]["r"]
    assert row["elasticity"] == pytest.approx(row["by_differences"], rel=1e-5)
    assert all(numbers["branches"]["K"]["stable"])
    for curve in numbers["curves"]["K"]:
        assert max(curve["off"]) < 1e-6
        assert len(curve["values"]) == 5
    # The stiffer the ground, the flatter the slope that still keeps the gait.
    fold = numbers["curves"]["K"][0]["values"]
    assert fold == sorted(fold, key=lambda pair: -pair[0])
    assert fold == sorted(fold, key=lambda pair: pair[1])
