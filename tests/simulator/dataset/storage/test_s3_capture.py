"""Whole captures by the command into an S3 server: broken off, damaged, gone on with, made larger; a folder's bytes."""

import json
from pathlib import Path

import pytest

import flyaround.cli.datasets as commands
from flyaround.__main__ import run
from flyaround.simulator.dataset.capture import capture

pytestmark = [pytest.mark.gl, pytest.mark.slow, pytest.mark.timeout(900)]
boto3 = pytest.importorskip("boto3")

RECIPE = """
schema = "flyaround.recipe"
version = 1
base = "eval-black"
target = "tango@low"
[camera]
width_px = 384
height_px = 240
fx_px = 600.0
fy_px = 600.0
cx_px = 191.5
cy_px = 119.5
[output]
labels = ["depth", "parts"]
[second_camera]
position_m = [0.4, 0.0, 0.0]
"""
FORMATS = "speed,bop,coco,yolo,webdataset"


@pytest.fixture
def recipe(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("pair.toml").write_text(RECIPE)
    return "pair.toml"


def _objects():
    """Bytes of all objects of the set, by name within it."""
    client = boto3.client("s3")
    pages = client.get_paginator("list_objects_v2").paginate(Bucket="bucket", Prefix="set/")
    keys = [one["Key"] for page in pages for one in page.get("Contents", ())]
    return {k.removeprefix("set/"): client.get_object(Bucket="bucket", Key=k)["Body"].read() for k in keys}


def _files(folder):
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in Path(folder).rglob("*") if p.is_file()}


def test_a_capture_into_s3_is_that_into_a_folder_whatever_befalls_it(s3, recipe, monkeypatch, capsys):
    def taken(place, n, *options):
        code = run(["capture", recipe, "-n", str(n), "-o", place, "--format", FORMATS, "--json", *options])
        out = capsys.readouterr().out
        return code, json.loads(out) if out.strip() else None

    # broken off after two frames
    def broken_off(*arguments, **options):
        def stop(done, _of):
            if done == 2:
                raise KeyboardInterrupt

        return capture(*arguments, **options | {"progress": stop})

    with monkeypatch.context() as patch:
        patch.setattr(commands, "capture_plan", broken_off)
        assert taken(s3, 4)[0] == 130
    half = _objects()
    assert "images/000001.json" in half
    assert "images/000003.json" not in half
    assert json.loads(half["dataset.json"])["complete"] is False
    assert taken(s3, 4)[0] == 2  # it is not empty

    # gone on with, by two processes; then damaged, gone on with, and made larger
    code, summary = taken(s3, 4, "--resume", "--workers", "2")
    assert (code, summary["kept"], summary["written"], summary["second"]["written"]) == (0, 2, 2, 4)
    client = boto3.client("s3")
    client.put_object(Bucket="bucket", Key="set/images/000001.png", Body=b"damaged")
    client.delete_object(Bucket="bucket", Key="set/second/images/000003.json")
    code, summary = taken(s3, 5, "--resume")
    assert (code, summary["damaged"], summary["written"], summary["second"]["written"]) == (0, [1], 2, 2)

    code, _ = taken("here", 5)
    assert code == 0
    there, here = _objects(), _files("here")
    assert sorted(there) == sorted(name for name in here if not name.startswith("."))
    assert [name for name in there if there[name] != here[name]] == []

    # copied here it is a data set like any other
    for name, data in there.items():
        path = Path("copy") / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    assert run(["check", "copy"]) == 0


def test_a_bucket_that_is_not_there_is_refused_before_anything_is_drawn(s3, recipe, capsys):
    assert run(["capture", recipe, "-n", "1", "-o", "s3://nobucket/set"]) == 2
    assert "s3://nobucket/set" in capsys.readouterr().err
