"""Speed of devices, at its quick size, against lanes' bits on an emulated one."""

import pytest

from tests.compiler.fake_driver import install
from tests.drawn import assert_is_drawn
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_without_a_device_it_says_so(tmp_path, monkeypatch):
    install(monkeypatch, devices=0)
    numbers, figures = quick_run("gpu_speed", tmp_path)
    assert numbers["missing"] == "there is no CUDA device"
    assert not figures
    assert not {"walks", "labels", "peak_flops"} & set(numbers)
    for row in numbers["assembled"]:
        assert row["registers"] <= 255
        assert row["warps"] == 8


def test_where_a_device_is_it_runs_to_its_end(tmp_path, monkeypatch):
    install(monkeypatch, lanes=2, multiprocessors=1)
    numbers, figures = quick_run("gpu_speed", tmp_path)
    assert numbers["devices"] == ["emulated 0"]
    assert numbers["peak_flops"] > 0.0
    assert [row["same_bits"] for row in numbers["errors"]] == [1.0]
    assert [row["labels_that_differ"] for row in numbers["labels"]] == [0]
    assert_is_drawn(
        figures["gpu_speed.png"], unitless={"starts in the batch", "attempted steps a second"}
    )
