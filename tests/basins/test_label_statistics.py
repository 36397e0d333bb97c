"""Fractions and entropies of labels, against closed forms, SciPy and a published table."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom, binomtest, gamma

import jaxbiped as jb
from tests.basins.known_basins import NEWTON_BOX, ball, newton, on_lattice

# Newcombe, Stat. Med. 17 (1998) 857, table I, method 3: count, total, lower, upper. The lower end
# of 1 in 29 is 0.0061 there, and ours is that of Poisson's distribution: -log(0.95) / 29.
NEWCOMBE = [
    (81, 263, 0.2553, 0.3662),
    (15, 148, 0.0624, 0.1605),
    (0, 20, 0.0, 0.1611),
    (1, 29, 0.00177, 0.1718),
]


@pytest.mark.parametrize(("count", "total", "low", "high"), NEWCOMBE)
def test_wilson_equals_the_published_table(count, total, low, high):
    np.testing.assert_allclose(jb.basins.wilson_interval(count, total), (low, high), atol=5e-5)


@settings(deadline=None, max_examples=40)
@given(st.integers(1, 10**6), st.data(), st.floats(0.01, 0.999))
def test_wilson_equals_scipy(total, data, confidence):
    """But for ends of 1 to 3 counts, or failures, which are Poisson's where these lie farther."""
    count = data.draw(st.integers(0, total))
    expected = binomtest(count, total).proportion_ci(confidence, method="wilson")
    low, high = jb.basins.wilson_interval(count, total, confidence=confidence)

    def lowest(wilson, count):
        if not 0 < count <= 3:
            return wilson
        return min(wilson, gamma(count).ppf(1.0 - confidence) / total)

    assert low == pytest.approx(lowest(expected.low, count), rel=1e-9, abs=1e-12)
    assert 1.0 - high == pytest.approx(
        lowest(1.0 - expected.high, total - count), rel=1e-9, abs=1e-12
    )


@pytest.mark.parametrize("total", [20, 300, 3000])
def test_intervals_of_rare_labels_hold_the_truth_as_often_as_others(total):
    """By the binomial distribution itself, whatever the fraction: 83.8 % by Wilson's alone."""
    count, expected = np.arange(total + 1), np.logspace(-2.0, np.log10(0.5 * total), 400)
    low, high = jb.basins.wilson_interval(count, total)
    for fraction in (*expected / total, *(1.0 - expected / total), 0.0, 1.0):
        inside = (low <= fraction) & (fraction <= high)
        assert binom.pmf(count, total, fraction)[inside].sum() > 0.92


def test_wilson_of_arrays_and_of_nothing():
    low, high = jb.basins.wilson_interval([0, 0, 5], [0, 5, 5], confidence=0.9)
    assert (low[0], high[0]) == (0.0, 1.0)
    assert (low[1], high[2]) == (0.0, 1.0)
    assert high[1] == pytest.approx(1.0 - low[2])
    low, high = jb.basins.wilson_interval([[0], [5]], [5, 10, 20])
    assert low.shape == high.shape == (2, 3)


def test_fractions_count_what_is_labelled():
    names = np.array([["stopped", "pending"], ["fell forward", "stopped"]])
    found = jb.basins.fractions(names)
    assert list(found) == ["stopped", "fell forward"]
    low, high = jb.basins.wilson_interval(2, 3)
    assert found["stopped"] == jb.basins.Fraction(2 / 3, float(low), float(high), 2)
    assert found["fell forward"].count == 1


def test_codes_are_names():
    codes = np.array([0, 1, 1, 3, -1, 0, 8])
    named = [str(jb.basins.Label(code)) for code in codes]
    assert jb.basins.fractions(codes) == jb.basins.fractions(named)
    assert set(jb.basins.fractions(codes)) == {"walking", "fell forward", "stopped", "unresolved"}
    assert sum(part.estimate for part in jb.basins.fractions(codes).values()) == pytest.approx(1.0)


def test_a_higher_confidence_is_a_wider_interval():
    narrow, wide = (jb.basins.fractions(["a", "b"], confidence=c)["a"] for c in (0.5, 0.99))
    assert wide.low < narrow.low < 0.5 < narrow.high < wide.high


def test_nothing_labelled_has_no_fractions():
    assert jb.basins.fractions(["pending", "pending"]) == {}


def test_labels_in_doubt_widen_the_intervals():
    codes, doubt = np.array([0] * 60 + [1] * 40), np.zeros(100, dtype=bool)
    plain = jb.basins.fractions(codes)
    assert jb.basins.fractions(codes, doubt=doubt) == plain
    doubt[[0, 1, 99]] = True
    found = jb.basins.fractions(codes, doubt=doubt)["walking"]
    assert (found.estimate, found.count) == (0.6, 60)
    assert found.low == pytest.approx(float(jb.basins.wilson_interval(58, 100)[0]))
    assert found.high == pytest.approx(float(jb.basins.wilson_interval(61, 100)[1]))


def test_a_label_that_does_not_occur_has_the_fraction_zero_with_its_interval():
    found = jb.basins.fractions(["stopped"] * 10)
    low, high = jb.basins.wilson_interval(0, 10)
    assert found["walking"] == jb.basins.Fraction(0.0, float(low), float(high), 0)
    assert list(found) == ["stopped"]
    assert jb.basins.fractions(["stopped"] * 9 + ["walking"], doubt=[0] * 9 + [1])[
        "fell forward"
    ].high == pytest.approx(float(jb.basins.wilson_interval(1, 10)[1]))
    with pytest.raises(jb.ArgumentError, match="walkin"):
        found["walkin"]


def _entropy(*parts):
    return -sum(p * np.log(p) for p in parts)


@settings(deadline=None, max_examples=30)
@given(st.integers(2, 8), st.integers(3, 9), st.data())
def test_an_upright_line_in_closed_form(box, boxes, data):
    """One column of boxes is parted, each with `part` of its rows below the line."""
    edge = data.draw(st.integers(1, box * boxes - 1))
    labels = np.zeros((box * boxes, box * boxes), dtype=int)
    labels[edge:] = 3
    found = jb.basins.entropy(labels, box=box)
    part = (edge % box) / box
    expected = _entropy(part, 1.0 - part) if part else 0.0
    assert found.basin == pytest.approx(expected / boxes, abs=1e-12)
    assert found.boundary_boxes == (boxes if part else 0)
    if part:
        assert found.boundary == pytest.approx(expected)
    else:
        assert np.isnan(found.boundary)
    assert not found.fractal


def test_lines_at_all_offsets_average_to_half_a_nat():
    """The integral of the entropy over the part p from 0 to 1 is 1/2."""
    box = 200
    rows = np.arange(box)[:, None]
    found = [jb.basins.entropy(np.tile(1 * (rows < k), box), box=box) for k in range(1, box)]
    assert np.mean([one.boundary for one in found]) == pytest.approx(0.5, abs=0.005)


def test_boxes_of_four_labels_exceed_log_two():
    labels = np.tile([[0, 1], [2, 3]], (6, 6))
    found = jb.basins.entropy(labels, box=2)
    assert found.basin == pytest.approx(np.log(4.0))
    assert found.boundary == pytest.approx(np.log(4.0))
    assert found.boundary_error == pytest.approx(0.0, abs=1e-15)
    assert (found.boxes, found.boundary_boxes, found.fractal) == (36, 36, True)


def test_boxes_of_a_cube_and_what_does_not_fill_one():
    labels = np.zeros((9, 8, 8), dtype=int)
    labels[2:4, :4, :4] = 1
    labels[8] = 5
    found = jb.basins.entropy(labels, box=4)
    assert (found.boxes, found.boundary_boxes) == (8, 1)
    assert found.boundary == pytest.approx(np.log(2.0))
    assert found.basin == pytest.approx(np.log(2.0) / 8)
    assert np.isnan(found.boundary_error)


def test_error_of_the_mean():
    labels = np.zeros((4, 12), dtype=int)
    labels[0, 0] = labels[:2, 4:8] = 1
    parts = [_entropy(1 / 16, 15 / 16), np.log(2.0)]
    found = jb.basins.entropy(labels, box=4)
    assert found.boundary == pytest.approx(np.mean(parts))
    assert found.boundary_error == pytest.approx(np.std(parts, ddof=1) / np.sqrt(2.0))


def test_newtons_basins_are_fractal_and_a_disc_is_not():
    newtons = jb.basins.entropy(on_lattice(newton, *NEWTON_BOX, (600, 600)))
    assert newtons.fractal
    assert newtons.boundary - 3 * newtons.boundary_error > np.log(2.0)
    disc = jb.basins.entropy(on_lattice(ball((0.1, 0.0), 0.6), (-1, -1), (1, 1), (600, 600)))
    assert not disc.fractal
    assert disc.boundary + 3 * disc.boundary_error < np.log(2.0)
    assert disc.basin < newtons.basin
