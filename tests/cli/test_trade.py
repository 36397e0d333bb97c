"""`jaxbiped trade`, against errors that fall with the tolerance."""

import pytest

from tests.cli.commands import outputs_of
from tests.drawn import assert_is_drawn


@pytest.mark.nightly
def test_errors_and_costs_of_the_named_accuracies(tmp_path):
    code, folder, figures, numbers = outputs_of(tmp_path, "trade", "--duration", "0.5")
    assert code == 0
    axes = ("state", "step_time", "energy", "period", "multiplier", "gradient")
    assert set(figures) == {f"trade_{axis}.png" for axis in axes}
    for name, figure in figures.items():
        assert (folder / name).is_file()
        assert_is_drawn(figure)
    assert max(numbers["floors"]["walk"].values()) < 1e-9
    rows = numbers["rows"]
    assert all(row["outcome"] == "ok" and row["seconds"] > 0.0 for row in rows)
    usual = (("walk", "rodas4p", "state"), ("gait", "rodas4", "multiplier"))
    for of, solver, axis in usual:
        draft, balanced, tight = (
            row for row in rows if row["of"] == of and row["way"] == f"{solver} (lanes)"
        )
        settings = [row["setting"] for row in (draft, balanced, tight)]
        assert settings == ["draft", "balanced", "tight"]
        assert draft["errors"][axis] > balanced["errors"][axis] > tight["errors"][axis]
    best = numbers["cheapest"]["walk"]["state"]
    assert best["1e-08"]["setting"] == "tight"
