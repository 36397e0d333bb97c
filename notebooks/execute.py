"""Runs notebooks at full size and keeps them with their outputs: `make notebooks`.

    python notebooks/execute.py [first_walk …]

All of them unless some are named, one after the other. What only tells of the machine that they ran
on is not kept: times of execution, warnings and progress (stderr), versions of Python. A notebook
that fails, grows too large or names a folder of the machine is not written.
"""

import base64
import io
import os
import re
import sys
import time
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from PIL import Image

HERE = Path(__file__).parent
LARGEST = 1_000_000
"""Bytes of a notebook with its outputs."""
COLOURS = 256
"""Of a picture that is kept: figures have few, and a palette makes them three times lighter."""
FOLDERS = re.compile(r"/(?:home|root|tmp|work|mnt|Users|usr|var|opt)/[\w.]")
"""Absolute paths, which belong to a machine."""


def main() -> None:
    names = sys.argv[1:] or sorted(path.stem for path in HERE.glob("*.ipynb"))
    os.environ["JAXBIPED_NOTEBOOK_SIZE"] = "full"
    for name in names:
        began = time.perf_counter()
        path = HERE / f"{name}.ipynb"
        text = executed(path)
        path.write_text(text)
        print(f"{path.name}: {len(text) / 1e3:.0f} kB, {time.perf_counter() - began:.0f} s")


def executed(path: Path) -> str:
    """The notebook with the outputs of a fresh run, as text."""
    notebook = nbformat.read(path, as_version=4)
    about = dict(notebook.metadata)
    NotebookClient(
        notebook,
        timeout=1800,
        kernel_name="python3",
        record_timing=False,
        resources={"metadata": {"path": str(HERE)}},
    ).execute()
    notebook.metadata = about
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs = joined([each for each in cell.outputs if not is_passing(each)])
            for output in cell.outputs:
                if "image/png" in output.get("data", {}):
                    output.data["image/png"] = lighter(output.data["image/png"])
    nbformat.validate(notebook)
    text = nbformat.writes(notebook) + "\n"
    named = {found.group() for cell in notebook.cells for found in FOLDERS.finditer(said(cell))}
    if named:
        raise ValueError(f"{path.name} names folders of this machine, {sorted(named)}.")
    if len(text.encode()) > LARGEST:
        raise ValueError(f"{path.name} has {len(text.encode())} bytes: at most {LARGEST} are kept.")
    return text


def is_passing(output: nbformat.NotebookNode) -> bool:
    """Whether an output is a warning or progress; a line of progress is empty in the end."""
    return output.get("name") == "stderr" or output.get("data") == {"text/plain": ""}


def joined(outputs: list[nbformat.NotebookNode]) -> list[nbformat.NotebookNode]:
    """The outputs with what was printed in a row as one, however the kernel cut it."""
    found: list[nbformat.NotebookNode] = []
    for output in outputs:
        if found and output.output_type == found[-1].output_type == "stream":
            found[-1].text += output.text
        else:
            found.append(output)
    return found


def lighter(png: str) -> str:
    """The same picture, Base64, with a palette."""
    picture, written = Image.open(io.BytesIO(base64.b64decode(png))), io.BytesIO()
    # Else the colours of thin lines are lost to those of large areas.
    way = Image.Quantize.MAXCOVERAGE
    few = picture.convert("RGB").quantize(COLOURS, way, dither=Image.Dither.NONE)
    few.save(written, "png", optimize=True)
    return base64.b64encode(written.getvalue()).decode()


def said(cell: nbformat.NotebookNode) -> str:
    """What a cell's outputs say in words."""
    outputs = cell.get("outputs", [])
    plain = [output.get("text", "") for output in outputs]
    return "\n".join(plain + [output.get("data", {}).get("text/plain", "") for output in outputs])


if __name__ == "__main__":
    main()
