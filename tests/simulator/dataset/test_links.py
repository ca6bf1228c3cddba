"""Data sets whose links or names lead out of their folder: nothing from elsewhere is read, copied or told."""

import json
import os
import shutil

import cv2
import numpy as np
import pytest
from small_flight import small_flight

import flyaround as fa
from flyaround.__main__ import run
from flyaround.simulator.dataset.capture import capture
from flyaround.simulator.dataset.formats.registry import read_foreign
from flyaround.simulator.errors import UserError

POSE = {"q_vbs2tango": [1.0, 0.0, 0.0, 0.0], "r_Vo2To_vbs_true": [0.0, 0.0, 5.0]}
PLUS = {"q_vbs2tango_true": [1.0, 0.0, 0.0, 0.0], "r_Vo2To_vbs_true": [0.0, 0.0, 5.0]}
PICTURE = cv2.imencode(".png", np.full((12, 16), 90, np.uint8))[1].tobytes()
CAMERA = {"Nu": 16, "Nv": 12, "fx": 1e-2, "fy": 1e-2, "ppx": 1e-4, "ppy": 1e-4, "ccx": 8, "ccy": 6}


def speed_set(folder, name="a.png"):
    (folder / "images" / "train").mkdir(parents=True)
    (folder / "train.json").write_text(json.dumps([{"filename": name, **POSE}]))
    return folder / "images" / "train"


def speedplus_set(folder, name="a.png"):
    (folder / "images").mkdir(parents=True)
    (folder / "train.json").write_text(json.dumps([{"filename": name, **PLUS}]))
    return folder / "images"


def shirt_set(folder, name="a.png"):
    (folder / "lightbox" / "images").mkdir(parents=True)
    (folder / "roe1.json").write_text(json.dumps([{"filename": name, **PLUS}]))
    return folder / "lightbox" / "images"


def urso_set(folder, name="a.png"):
    folder.mkdir(parents=True)
    (folder / "train_images.csv").write_text(f"{name}\n")
    (folder / "train_poses_gt.csv").write_text("x,y,z,q1,q2,q3,q4\n5,0,0,0.5,0.5,0.5,0.5\n")
    return folder


def spark_set(folder, name="a.png"):
    (folder / "images" / "train").mkdir(parents=True)
    (folder / "train.csv").write_text(f"filename,Tx,Ty,Tz,Qx,Qy,Qz,Qw\n{name},0,0,5,0,0,0,1\n")
    return folder / "images" / "train"


SETS = {
    "speed": speed_set,
    "speedplus": speedplus_set,
    "shirt": shirt_set,
    "urso": urso_set,
    "spark": spark_set,
}


@pytest.fixture
def private(tmp_path):
    """Make a folder beside the set, with a picture that is nobody's business."""
    folder = tmp_path / "private"
    folder.mkdir()
    (folder / "a.png").write_bytes(PICTURE)
    return folder


def replaced_by_link(path, target):
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
    path.symlink_to(os.path.relpath(target, path.parent))


@pytest.mark.parametrize("kind", SETS)
def test_a_link_to_a_picture_or_its_folder_is_refused(kind, tmp_path, private):
    place = SETS[kind](tmp_path / "set")
    (place / "a.png").write_bytes(PICTURE)
    found, _ = read_foreign(tmp_path / "set", kind)
    assert len(found.pictures) == 1
    (place / "b.png").write_bytes(PICTURE)
    replaced_by_link(place / "a.png", place / "b.png")  # within the set
    assert len(read_foreign(tmp_path / "set", kind)[0].pictures) == 1
    replaced_by_link(place / "a.png", private / "a.png")
    with pytest.raises(UserError, match=r"is a link to a file outside|not within"):
        read_foreign(tmp_path / "set", kind)
    if place != tmp_path / "set":
        replaced_by_link(place, private)
        with pytest.raises(UserError, match=r"is a link to a file outside|not within"):
            read_foreign(tmp_path / "set", kind)


@pytest.mark.parametrize("kind", SETS)
@pytest.mark.parametrize(
    "name", ["../private/a.png", "{private}/a.png", "..\\private\\a.png", "sub/../../../private/a.png"]
)
def test_a_name_that_leads_out_is_refused(kind, name, tmp_path, private):
    SETS[kind](tmp_path / "set", name.format(private=private))
    with pytest.raises(UserError, match=r"not within|is not in"):
        read_foreign(tmp_path / "set", kind)


@pytest.mark.parametrize("kind", SETS)
def test_a_list_or_camera_that_is_a_link_out_is_refused(kind, tmp_path, private):
    root = tmp_path / "set"
    place = SETS[kind](root)
    (place / "a.png").write_bytes(PICTURE)
    for path in sorted(root.glob("*.*")):
        if path.suffix in (".json", ".csv"):
            shutil.move(path, private / path.name)
            path.symlink_to(private / path.name)
            with pytest.raises(UserError, match="is a link to a file outside"):
                read_foreign(root, kind)
            path.unlink()
            shutil.move(private / path.name, path)
    (private / "camera.json").write_text(json.dumps(CAMERA))
    (root / "camera.json").symlink_to(private / "camera.json")
    with pytest.raises(UserError, match="is a link to a file outside"):
        read_foreign(root, kind)


@pytest.fixture(scope="module")
def native(tmp_path_factory):
    """Capture two small frames."""
    folder = tmp_path_factory.mktemp("native") / "set"
    capture(
        small_flight(192, n=2),
        folder,
        labels=("depth",),
        split=(1, 1, 0),
    )
    return folder


@pytest.mark.gl
@pytest.mark.parametrize(
    "name",
    ["images", "dataset.json", "split.json"]
    + [f"images/000001.{end}" for end in ("png", "json", "mask.png", "depth.exr")],
)
def test_links_out_of_a_native_set_are_refused(name, native, tmp_path, private, capsys):
    folder = tmp_path / "set"
    shutil.copytree(native, folder)
    shutil.move(folder / name, private / "taken")
    (folder / name).symlink_to(private / "taken")
    out = tmp_path / "out"
    assert run(["convert", str(folder), "-o", str(out), "--format", "webdataset"]) == 2
    assert "is a link to a file outside" in capsys.readouterr().err
    if not name.endswith("exr"):  # what is found at once leaves nothing half-written
        assert not out.exists()
        with pytest.raises(UserError, match="is a link to a file outside"):
            fa.open_dataset(folder)
        assert run(["check", str(folder), "--redraw", "0"]) == 2 or name == "split.json"


@pytest.mark.gl
def test_a_native_set_that_is_a_link_itself_is_read(native, tmp_path):
    (tmp_path / "mine").symlink_to(native)
    assert len(fa.open_dataset(tmp_path / "mine")) == 2


@pytest.mark.gl
def test_convert_writes_several_formats(native, tmp_path):
    out = tmp_path / "out"
    assert run(["convert", str(native), "-o", str(out), "--format", "coco,yolo"]) == 0
    assert {p.name for p in out.iterdir()} == {"coco", "yolo", "run.toml"}
    alone = tmp_path / "alone"
    assert run(["convert", str(native), "-o", str(alone), "--format", "coco, coco,"]) == 0
    written = {str(p.relative_to(out / "coco")): p.read_bytes() for p in (out / "coco").rglob("*.*")}
    (alone / "run.toml").unlink(missing_ok=True)
    assert written == {str(p.relative_to(alone)): p.read_bytes() for p in alone.rglob("*.*")}
