"""Stores at addresses, against the same ones on a disk: an S3 server that runs here."""

import sys

import numpy as np
import pytest
import xarray as xr

import jaxbiped as jb
from tests.rigid_walkers import STABLE, simplest_state, simplest_walker
from tests.sweep.walkers import ByFormula, as_kind, gaitless, same_results

SCENE, STATE = simplest_walker(0.009), simplest_state(*STABLE)
LABELLING = as_kind(ByFormula, gaitless(SCENE, STATE))
ADDRESS = "s3://walks/of/basin.zarr"


def swept(store=None, high=0.3, **options):
    axes = {"theta_stance": np.linspace(0.1, high, 6), "omega_stance": (-1.2, -1.0)}
    how = dict(store=store, chunk=4, look_for_gaits=False) | options
    return jb.sweep(LABELLING, jb.starts.grid(SCENE, axes), **how)


@pytest.fixture
def bucket(monkeypatch):
    """An empty bucket of a server on this machine."""
    server = pytest.importorskip("moto.server", reason="moto is not installed")
    for package in ("s3fs", "upath"):
        pytest.importorskip(package, reason=f"{package} is not installed")
    import boto3
    import s3fs

    s3fs.S3FileSystem.clear_instance_cache()  # they would know the last server
    running = server.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    running.start()
    host, port = running.get_host_and_port()
    known = dict(AWS_ACCESS_KEY_ID="me", AWS_SECRET_ACCESS_KEY="mine", AWS_REGION="us-east-1")
    for name, value in (known | {"AWS_ENDPOINT_URL": f"http://{host}:{port}"}).items():
        monkeypatch.setenv(name, value)
    client = boto3.client("s3", region_name="us-east-1")
    client.create_bucket(Bucket="walks")
    yield client
    running.stop()


def objects(bucket):
    found = bucket.list_objects_v2(Bucket="walks").get("Contents", [])
    return {each["Key"] for each in found}


@pytest.mark.nightly
def test_a_sweep_into_a_bucket_is_the_one_in_memory_and_is_continued(bucket, by_formula):
    found = swept(ADDRESS)
    assert sum(by_formula) == 12
    same_results(found, swept())
    same_results(xr.open_zarr(ADDRESS, chunks=None), found)
    again = swept(ADDRESS)
    assert (again.attrs["labelled_in_this_run"], again.attrs["chunks_found_complete"]) == (0, 3)
    names = objects(bucket)
    assert "of/basin.zarr/zarr.json" in names
    assert not [each for each in names if "unfinished" in each]
    bucket.delete_object(Bucket="walks", Key="of/basin.zarr/label/c/2/0")
    before = sum(by_formula)
    with pytest.warns(RuntimeWarning, match="1 of its chunks were lost or damaged"):
        same_results(swept(ADDRESS), found)
    assert sum(by_formula) - before == 4


@pytest.mark.nightly
def test_what_is_in_a_bucket_is_not_written_over(bucket, by_formula):
    swept(ADDRESS)
    with pytest.raises(jb.ArgumentError, match="was made with other settings: starts"):
        swept(ADDRESS, high=0.31)
    bucket.put_object(Bucket="walks", Key="notes/mine.txt", Body=b"mine")
    with pytest.raises(jb.ArgumentError, match="s3://walks/notes' holds something else"):
        swept("s3://walks/notes")
    with pytest.raises(jb.ArgumentError, match=r"s3://nowhere/basin\.zarr' cannot be written"):
        swept("s3://nowhere/basin.zarr")


@pytest.mark.nightly
def test_gaits_go_into_a_bucket(bucket):
    over = {"slope": [0.009, 0.01]}
    first = jb.gait_sweep(SCENE, over, parameters=(), store="s3://walks/gaits.zarr").load()
    again = jb.gait_sweep(SCENE, over, parameters=(), store="s3://walks/gaits.zarr").load()
    plain = jb.gait_sweep(SCENE, over, parameters=())
    assert first.identical(again)
    np.testing.assert_array_equal(first.period, plain.period)


def test_a_missing_package_and_an_unknown_address_are_one_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "upath", None)
    with pytest.raises(jb.ResourceError, match=r"is missing: pip install jaxbiped\[s3\]"):
        jb.gait_sweep(SCENE, {"slope": [0.009]}, store="s3://walks/gaits.zarr")
    monkeypatch.undo()
    pytest.importorskip("upath", reason="universal-pathlib is not installed")
    with pytest.raises(jb.ArgumentError, match="must be a directory, or an address"):
        jb.gait_sweep(SCENE, {"slope": [0.009]}, store="nothing://walks/gaits.zarr")


def test_a_store_at_a_file_address_is_the_one_at_its_path(tmp_path, by_formula):
    address = (tmp_path / "a folder" / "store.zarr").as_uri()
    assert "%20" in address
    found = swept(address)
    same_results(found, swept())
    assert (tmp_path / "a folder" / "store.zarr" / "zarr.json").is_file()
    again = swept(tmp_path / "a folder" / "store.zarr")
    assert again.attrs["labelled_in_this_run"] == 0
    with pytest.raises(jb.ArgumentError, match="an address of a file begins with file:///"):
        swept("file://machine/store.zarr")
