"""`jaxbiped basin` as a user meets it, against its own stores, counts and refusals."""

import errno
import os

import numpy as np
import pytest
import xarray as xr
import zarr
from matplotlib.collections import QuadMesh
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

import jaxbiped as jb
from jaxbiped.plot.style import label_colour
from tests.cli.commands import asked, numbers_of, outputs_of, run
from tests.drawn import assert_is_drawn

pytestmark = pytest.mark.slow

HEADER = "hip_x,hip_z,theta_1,theta_2,hip_vx,hip_vz,omega_1,omega_2"
AXES = ("--x", "theta_swing=-0.5:0.3:9", "--y", "omega_swing=-2:4:7")


@pytest.fixture(scope="module")
def basin(tmp_path_factory):
    """The command run once with every output, and the arguments that go on with its store."""
    folder = tmp_path_factory.mktemp("basin")
    same = ("basin", *AXES, "--store", folder / "store", "--chunk", 18)
    return outputs_of(folder, *same), same


@pytest.fixture(scope="module")
def numbers(basin):
    assert basin[0].code == 0
    return basin[0].numbers


def test_json(numbers):
    assert {"fractions", "starts", "starts_per_s", "gaits", "wall_s"} <= set(numbers)
    assert numbers["starts"] == 63
    assert sum(numbers["counts"].values()) == 63
    for estimate, low, high in numbers["fractions"].values():
        assert 0.0 <= low <= estimate <= high <= 1.0
    assert sum(f[0] for f in numbers["fractions"].values()) == pytest.approx(1.0)
    assert "walking period-1" in numbers["fractions"]
    (gait,) = numbers["gaits"]
    assert gait["cycle_footsteps"] == 1
    assert gait["duration_s"] == pytest.approx(0.4408349, abs=1e-6)
    assert np.hypot(*gait["multipliers"][0]) == pytest.approx(0.457064, abs=1e-4)


def test_picture_and_results(basin, numbers):
    outputs, same = basin
    (ax,) = outputs.figures["basin.png"].axes
    assert_is_drawn(ax.figure)
    assert ax.get_xlabel() == r"swing leg angle, $\theta_1$ (rad)"
    found = xr.open_dataset(outputs.folder / "basin.nc")
    # Every cell has its label's colour.
    (mesh,) = [one for one in ax.collections if isinstance(one, QuadMesh)]
    mesh.update_scalarmappable()
    shown = [to_hex(colour).upper() for colour in mesh.get_facecolors()]
    names = jb.basins.label_names(found.label.values, 1).ravel()
    assert shown == [label_colour(str(name)) for name in names]
    assert found.label.dims == ("omega_swing", "theta_swing")
    # The gait is marked where it is on its section.
    (gait,) = numbers["gaits"]
    (star,) = [line for line in ax.lines if line.get_marker() == "*"]
    place = gait["coordinates"]
    assert tuple(star.get_xydata()[0]) == (place["theta_swing"], place["omega_swing"])
    assert place["theta_swing"] == place["theta_1"]
    assert found.theta_swing.attrs["units"] == "rad"
    stored = xr.open_zarr(same[-3])
    assert np.array_equal(stored.label, found.label)
    walks = int((found.label == jb.basins.Label.WALKING).sum())
    assert walks == numbers["counts"]["walking period-1"]


def test_a_second_run_finds_all_chunks_and_its_store_knows_its_settings(basin, capsys):
    same = basin[1]
    assert run(*same) == 0
    assert "63 starts, 0 of them labelled in this run" in capsys.readouterr().out
    assert run(*same, "--footsteps", 7) == 2
    assert "effort.footsteps = 30 there, 7 here" in capsys.readouterr().err
    zarr.open_group(str(same[-3]), mode="r+").attrs.update({"git_revision": "another"})
    assert run(*same) == 2
    assert "--any-version" in capsys.readouterr().err
    assert run(*same, "--any-version") == 0
    assert "0 of them labelled in this run" in capsys.readouterr().out


def test_given_starts(tmp_path, capsys):
    seed = [float(x) for x in jb.seed_state()]
    rows = [seed, [*seed[:4], -0.5, 0.0, 0.0, 1.2565], [0.0, np.nan, *seed[2:]]]
    text = "\n".join([HEADER, *(",".join(map(repr, row)) for row in rows)])
    (tmp_path / "starts.csv").write_text(text + "\n")
    # One of three starts fails to be solved.
    given = ("basin", "--starts", tmp_path / "starts.csv", "--out", tmp_path / "out")
    numbers = numbers_of(capsys, *given, code=1)
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["basin.nc"]
    assert numbers["labels"] == ["walking period-1", "stopped", "solver failed"]


def test_samples_over_a_rigid_walker_and_its_slope(capsys):
    arguments = ("--model", "rigid", "--x", "theta_stance=0.1:0.4:2", "--y", "slope=0.01:0.03:2")
    numbers = numbers_of(capsys, "basin", *arguments, "--samples", 100)
    assert numbers["starts"] == 100
    assert set(numbers["fractions"]) > {"fell forward"}
    # Most starts that walk have no outcome after a footstep, which the code tells.
    arguments = (*arguments[:3], "theta_stance=0.1rad:0.4:2", "--y", "slope=10mrad:0.03:2")
    assert run("basin", *arguments, "--samples", 100, "--footsteps", 1) == 1
    assert "unresolved" in capsys.readouterr().out


def test_the_share_of_wrong_labels_is_asked_for_and_told(tmp_path, capsys):
    arguments = ("--model", "rigid", "--accuracy", "1e-2", "--store", tmp_path / "store")
    axes = ("--x", "theta_stance=0.1:0.4:8", "--y", "omega_stance=-2:-1:8")
    outputs = outputs_of(tmp_path, "basin", *arguments, *axes)
    errors = outputs.numbers["label_errors"]
    assert outputs.code == 1  # it is not met
    assert (errors["starts"], errors["wanted"], errors["met"]) == (64, 1e-2, False)
    told = capsys.readouterr().out
    assert "fewer than 512 starts cannot confirm it" in told
    assert f"{errors['relabelled']} of 64 labels were in doubt at a tolerance of 3.0e-05" in told
    assert "95 % interval by Wilson and labels in doubt" in told
    found = xr.open_zarr(tmp_path / "store")
    assert errors["relabelled"] == int((found.doubt > 0).sum())
    assert jb.basins.label_errors(found).numbers() == errors
    names = jb.basins.label_names(found.label.values, found.cycle_footsteps.values)
    doubt = found.doubt.values == int(jb.basins.Doubt.REMAINS)
    for name, part in jb.basins.fractions(names, doubt=doubt).items():
        assert outputs.numbers["fractions"][name] == [part.estimate, part.low, part.high]


def test_a_full_disk_is_no_argument_of_ours(tmp_path, monkeypatch, capsys):
    """One sentence and exit code 1, not the 2 of what may be mended by another argument."""

    def full(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(zarr.Group, "create_array", full)
    assert run("basin", *AXES, "--store", tmp_path / "store") == 1
    assert capsys.readouterr().err.splitlines()[-1].startswith("jaxbiped: store = ")
    monkeypatch.setattr(Figure, "savefig", full)
    assert run("basin", *AXES, "--out", tmp_path / "out") == 1
    assert "No space left on device" in capsys.readouterr().err.splitlines()[-1]


def test_axes_that_nobody_chose(tmp_path):
    """Of legs of any name: a body that swings and one that stands where a cycle begins."""
    file = tmp_path / "walkers.py"
    for name, body in {"unequal": "leg", "kneed": "thigh"}.items():
        file.write_text(f"from tests.mechanisms import WALKERS\nown = WALKERS[{name!r}]")
        (_, axes), _ = asked(f"basin --walker {file}:own", "starts.grid")
        assert list(axes) == [f"omega_{body}_1", f"theta_{body}_1"]
