"""A search that was done before, against what it may still evaluate in Python."""

import sys
from pathlib import Path

import pytest

import jaxbiped as jb

pytestmark = pytest.mark.slow

PACKAGE = Path(jb.__file__).parent
SEED = jb.seed_scene()
RIGID = jb.RigidScene(SEED.walker, SEED.ground)
OPTIONS = dict(parameters=("K",), radius_sensitivities=False)


def modules_run(function):
    """The modules, as package/file, whose functions a call runs."""
    run = set()

    def note(frame, event, _):
        if event == "call":
            run.add("/".join(Path(frame.f_code.co_filename).parts[-2:]))

    sys.setprofile(note)
    try:
        function()
    finally:
        sys.setprofile(None)
    return run


@pytest.mark.parametrize(
    ("scene", "options"), [(SEED, OPTIONS), (RIGID, OPTIONS | {"parameters": ("slope",)})]
)
def test_it_traces_no_equation_of_motion(scene, options):
    equations = {
        "dynamics/_tree.py",
        "dynamics/_contacts.py",
        "hybrid/_compliant_guards.py",
        "dynamics/_stance_motion.py",
    }
    assert all((PACKAGE / name).exists() for name in equations)
    jb.find_gait(scene, **options)
    again = modules_run(lambda: jb.find_gait(scene, **options))
    assert "gait/_find_gait.py" in again
    assert not again & equations
