"""What the pages quote of the experiments, against the files of their results."""

import json
import re
from pathlib import Path

import _quote_words as words
import _quotes_of_gaits as gaits
import pytest
import quote

ROOT = Path(__file__).parents[1]
EXPERIMENTS = ROOT / "experiments"
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
TEXT = " ".join(" ".join(page.read_text().split()) for page in PAGES)

RESULTS = sorted(quote.RESULTS.glob("*.json"))


def _is_said(phrase, text=TEXT):
    """Whether a text has a phrase, with anything but a cell's end where the phrase is unknown."""
    parts = map(re.escape, " ".join(phrase.split()).split(words.UNKNOWN))
    return re.search("[^|]*".join(parts), text) is not None


@pytest.mark.parametrize("path", RESULTS, ids=lambda path: path.stem)
def test_pages_say_what_the_results_are(path):
    phrases = quote.quoted(path.stem)
    assert phrases
    for phrase in phrases:
        assert _is_said(phrase), phrase


@pytest.mark.parametrize("path", RESULTS, ids=lambda path: path.stem)
def test_results_belong_to_an_experiment_and_to_no_machine(path):
    assert (EXPERIMENTS / f"{path.stem}.py").is_file()
    text = path.read_text()
    assert len(text) < 100_000
    assert not re.search(r"/(home|root|tmp|work|Users|usr|var|opt)/", text)
    assert json.loads(text)


def test_every_quote_is_of_an_experiment():
    assert {path.stem for path in RESULTS} <= set(quote.QUOTES)
    assert all((EXPERIMENTS / f"{name}.py").is_file() for name in quote.QUOTES)


def test_another_number_is_seen():
    rows = quote.quoted("gradient_accuracy")
    said = " ".join(rows)
    assert all(_is_said(row, said) for row in rows)
    assert not _is_said(rows[0].replace("249", "248"), said)
    assert _is_said("| a… | 1 |", "| a, b | 1 |")
    assert not _is_said("| a… | 1 |", "| a | b | 1 |")


@pytest.mark.parametrize(
    ("number", "said"),
    [(1.66e-3, "1.7e-3"), (0.2149, "2.1e-1"), (1.55, "1.6"), (2.5e4, "2.5e4"), (None, "…")],
)
def test_numbers_are_written_as_the_pages_do(number, said):
    assert words.small(number) == said


@pytest.mark.parametrize("untimed", [False, True])
def test_results_are_kept_without_paths_and_timings(untimed, tmp_path, monkeypatch):
    monkeypatch.setattr(quote, "RESULTS", tmp_path / "results")
    run = {"costs": {"a": {"wall_s": 1.5, "error": 1e-6}}, "rows": [[1, 2]], "pictures": ["/x.png"]}
    (tmp_path / "made.json").write_text(json.dumps(run))
    kept = json.loads(quote.keep(tmp_path / "made.json", untimed=untimed).read_text())
    made = kept.pop("made")
    assert re.fullmatch(r"\d{4}-\d\d-\d\d", made["date"])
    assert re.match(r"\d+ cores", made["machine"])
    cost = {"error": 1e-6} if untimed else {"wall_s": 1.5, "error": 1e-6}
    assert kept == {"costs": {"a": cost}, "rows": [[1, 2]]}


def test_a_rung_that_was_timed_is_quoted_with_its_costs():
    numbers = json.loads((quote.RESULTS / "ladder.json").read_text())
    for cost in numbers["costs"].values():
        cost.update(single_us=231.6, batch_us=0.137, error=6.9e-5)
    rows = [each for each in gaits.of_ladder(numbers) if each.startswith("| rigid")]
    assert rows[:1] == ["| rigid… | 0.44378 | 0.19041 | 0.5025 | 232 µs | 0.14 µs | 6.9e-5 |"]


def test_searches_are_counted():
    """Of two families: walks settle in three scenes, and one of these is missed."""
    verdicts = [("agrees", 1), ("missed", 2), ("agrees", 1), ("none, no walk settles", -1)]
    rows = [{"verdict": verdict, "cycle": cycle} for verdict, cycle in verdicts]
    said = list(gaits.of_search_robustness({"slope": rows[:2], "random": rows[2:]}))
    assert said[0] == "of 4 scenes"
    assert said[1].endswith("cycle in 3, and the search finds all but 1 of them")
