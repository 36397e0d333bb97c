"""Every notebook, against a run at a small size and outputs of one at full size."""

import re
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

FOLDER = Path(__file__).parents[1] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
LARGEST = 1_000_000
"""Bytes of a notebook, so that the repository stays light and pages load."""


@pytest.mark.nightly
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs(path, monkeypatch):
    monkeypatch.setenv("JAXBIPED_NOTEBOOK_SIZE", "small")
    notebook = nbformat.read(path, as_version=4)
    client = NotebookClient(
        notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": path.parent}}
    )
    client.execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert any("image/png" in output.get("data", {}) for output in outputs)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_is_kept_with_its_outputs(path):
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    # One fresh run from top to bottom.
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    for cell in cells:
        kinds = {output.output_type for output in cell.outputs}
        assert "error" not in kinds, cell.source
        if re.search(r"^ *(print|display|plot\.\w+|plt\.show)\(", cell.source, re.MULTILINE):
            assert kinds, cell.source
    assert any("image/png" in output.get("data", {}) for cell in cells for output in cell.outputs)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_nothing_of_the_machine_is_kept(path):
    assert path.stat().st_size <= LARGEST
    notebook = nbformat.read(path, as_version=4)
    assert set(notebook.metadata) == {"kernelspec", "language_info"}
    assert notebook.metadata.language_info == {"name": "python"}
    for cell in notebook.cells:
        assert "execution" not in cell.metadata
        for output in cell.get("outputs", []):
            assert output.get("name") != "stderr"
            said = output.get("text", "") + output.get("data", {}).get("text/plain", "")
            assert not re.search(r"(?<!\w)/(home|root|tmp|work|Users|usr|var|opt)/\w", said)


def test_each_lesson_has_one_question_and_one_exercise():
    for path in NOTEBOOKS:
        cells = nbformat.read(path, as_version=4).cells
        words = [cell.source for cell in cells if cell.cell_type == "markdown"]
        title, question, *_ = words[0].split("\n\n")
        assert title.startswith("# "), path
        assert re.fullmatch(r"\*\*Question\.\*\* .*\?", question), path
        assert sum(each.count("**Question.**") for each in words) == 1, path
        assert sum(each.count("**Exercise.**") for each in words) == 1, path


def test_readme_and_site_list_the_same_lessons_in_the_same_order():
    root = FOLDER.parent
    readme = re.findall(r"\(notebooks/(\w+)\.ipynb\)", (root / "README.md").read_text())
    site = re.findall(r"^\.\./notebooks/(\w+)$", (root / "docs/index.md").read_text(), re.MULTILINE)
    assert readme == site
    assert sorted(site) == [path.stem for path in NOTEBOOKS]
    assert len(site) <= 11
