"""Work of a solve, against a clock made by hand."""

from jaxbiped.trade import work_of


def test_the_first_run_does_not_count_as_a_warm_one():
    calls = []
    found, work = work_of(lambda: calls.append(0) or len(calls), repeats=3)
    assert (found, len(calls)) == (4, 4)
    assert min(work) >= 0.0
