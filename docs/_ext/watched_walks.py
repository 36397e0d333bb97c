"""Walks that a page of the site plays, and a page that simulates its own: made with the site."""

from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

FOOTSTEPS = 12


def write_page(app: Sphinx, failure: Exception | None) -> None:
    """Puts `docs/walks.html` and `docs/play.html` into a site that was built."""
    if failure is None and app.builder.format == "html":
        folder = Path(app.outdir) / "docs"
        views().save(folder / "walks.html")
        playground().save(folder / "play.html")


def playground() -> Any:
    """The seed's walker, with sliders."""
    import jaxbiped as jb

    return jb.plot.playground(jb.seed_scene(slope=0.02), jb.seed_state())


def views() -> Any:
    """The seed's walker on compliant and on rigid feet, under one clock."""
    import jaxbiped as jb

    scene, rigid = jb.seed_scene(slope=0.02), jb.ladder()["rigid"]
    walk = jb.simulate(scene, jb.seed_state(), footsteps=FOOTSTEPS)
    start = jb.dynamics.rigid_state(jb.seed_state())
    rolled = jb.rigid_walk(rigid, start, footsteps=FOOTSTEPS, max_arrivals=FOOTSTEPS)
    return jb.plot.side_by_side(
        jb.plot.view(scene, walk, name="on compliant feet"),
        jb.plot.view(rigid, rolled, start=start, name="on rigid feet"),
    )


def setup(app: Sphinx) -> dict[str, bool]:
    """Writes the pages when all others are there."""
    app.connect("build-finished", write_page)
    return {"parallel_read_safe": True}
