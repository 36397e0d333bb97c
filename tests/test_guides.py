"""The guides, against what their blocks of Python print and what they link to."""

import ast
import json
import re
import sys
import types
from pathlib import Path

import pytest

from tests.public_names import is_there

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
GUIDES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").glob("*.md"))]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
BLOCK = re.compile(r"^(<!-- not run -->\n)?```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
"""A block of Python, perhaps one that needs what a test does not have, such as other machines."""
path_of = lambda page: str(page.relative_to(ROOT))


def program_of(page, *, runs):
    """The page's blocks of Python as one program, each line where it stands on the page."""
    text = page.read_text()
    lines = [""] * text.count("\n")
    for block in BLOCK.finditer(text):
        if runs == (block[1] is None):
            first = text.count("\n", 0, block.start(2))
            code = block[2].splitlines()
            lines[first : first + len(code)] = code
    return "\n".join(lines)


RUN = [page for page in GUIDES if program_of(page, runs=True).strip()]
SUBJECTS = ("simulating", "gaits", "gradients", "basins")
LANDING = {"README.md", *(f"docs/{name}.md" for name in SUBJECTS)}
"""Pages that a change waits for; the others run at night."""
TIERED = [
    pytest.param(
        page,
        marks=pytest.mark.slow if path_of(page) in LANDING else pytest.mark.nightly,
        id=path_of(page),
    )
    for page in RUN
]


def shown_in(page):
    """What a page or a notebook says: all of a page, a notebook without its code."""
    if page not in NOTEBOOKS:
        return page.read_text()
    cells = json.loads(page.read_text())["cells"]
    return "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")


@pytest.mark.parametrize("page", TIERED)
def test_a_page_runs_from_top_to_bottom_and_prints_what_it_says(page, tmp_path, monkeypatch):
    """A comment behind a `print(…)` is what that prints, as far as an ellipsis."""
    monkeypatch.chdir(tmp_path)
    program, printed = program_of(page, runs=True), {}

    def note(*values):
        printed[sys._getframe(1).f_lineno] = " ".join(map(str, values))

    space = vars(types.ModuleType("page")) | {"print": note}
    exec(compile(program, path_of(page), "exec"), space)
    for number, line in enumerate(program.splitlines(), 1):
        if line.startswith("print(") and "  # " in line:
            words, ellipsis, _ = line.split("  # ")[1].partition("…")
            shown = printed[number]
            assert shown.startswith(words) if ellipsis else shown == words, (line, shown)


@pytest.mark.parametrize("page", GUIDES, ids=path_of)
def test_every_block_of_a_page_is_found(page):
    assert len(BLOCK.findall(page.read_text())) == page.read_text().count("```python")
    ast.parse(program_of(page, runs=False))


def test_the_readme_is_short_and_it_and_the_pages_of_each_subject_are_run():
    assert len(README.read_text().splitlines()) <= 120
    assert {path_of(page) for page in RUN} >= LANDING


@pytest.mark.parametrize("page", [*GUIDES, *NOTEBOOKS], ids=path_of)
def test_names_of_the_package_exist(page):
    text = shown_in(page)
    if page.name == "CONTRIBUTING.md":
        text = BLOCK.sub("", text)  # Those that make names of their own: see `test_walk_through`.
    names = set(re.findall(r"\bjb(?:\.\w+)+", text))
    assert {name for name in names if not is_there(name)} == set()


@pytest.mark.parametrize("page", GUIDES, ids=path_of)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)]+)\)", page.read_text()):
        if "://" not in target:
            file, _, heading = target.partition("#")
            linked = page.parent / file if file else page
            assert linked.exists(), target
            assert not heading or heading in _anchors(linked), target


def test_every_page_can_be_reached_from_the_readme_or_from_contributing():
    doors = "".join((ROOT / name).read_text() for name in ("README.md", "CONTRIBUTING.md"))
    assert [page for page in GUIDES if path_of(page) not in doors and page != README] == []


def test_no_two_pages_have_one_title():
    titles = [
        re.search(r"^# (.*)$", shown_in(page), re.MULTILINE)[1] for page in GUIDES + NOTEBOOKS
    ]
    repeated = {title for title in titles if titles.count(title) > 1}
    assert repeated == set()


def _anchors(page):
    titles = re.findall(r"^#+ (.*)$", page.read_text(), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title).lower().replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", GUIDES, ids=path_of)
def test_files_that_are_named_exist(page):
    for name in re.findall(r"`((?:experiments|jaxbiped|tests|docs)/[\w/]+\.\w+)", shown_in(page)):
        made_by_the_walk_through = name.endswith("_algebraic.py")
        assert made_by_the_walk_through or (ROOT / name).exists(), name


def test_the_command_line_page_has_every_flag_and_no_other(capsys):
    from jaxbiped.cli import COMMANDS, main

    sys.path.append(str(ROOT / "docs" / "_ext"))
    try:
        from markdown_tables import groups, rows
    finally:
        sys.path.pop()
    helps = ""
    for command in set(COMMANDS) - {"version"}:
        with pytest.raises(SystemExit):
            main([command, "--help"])
        helps += "".join(capsys.readouterr())
    page = (ROOT / "docs" / "command_line.md").read_text()
    kinds = COMMANDS | groups()
    tables = [kinds[name] for name in re.findall(r"^```{options} (\w+)$", page, re.MULTILINE)]
    listed = {flag for kind in tables for flag, *_ in rows(kind)}
    flag = re.compile(r"--[a-zA-Z][\w-]*")
    offered = {each for each in flag.findall(helps) if not each.startswith("--no-")}
    assert offered - listed == {"--help"}
    named = set(flag.findall(page)) - {"--version", "--tyro-print-completion"}
    assert len(named) > 20
    assert named - offered == set()
