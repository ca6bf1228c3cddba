"""YOLO-pose read back by its public page and by the rule of Ultralytics for folders."""

import shutil

import cv2
import msgspec
import numpy as np
import pytest
import yaml

import flyaround as fa
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.dataset.formats.labelled_frame import frame_from_folder
from flyaround.simulator.dataset.formats.registry import find_format

pytestmark = pytest.mark.gl

SHORT = {"train": "train", "validation": "val", "test": "test"}


def test_yolo(everything):
    """https://docs.ultralytics.com/datasets/pose/."""
    root, frames = everything / "yolo", list(fa.open_dataset(everything))
    about = yaml.safe_load((root / "data.yaml").read_text())
    assert about["names"] == {0: "tango@low"}
    count = about["kpt_shape"][0]
    assert about["kpt_shape"][1] == 3
    assert about["kpt_names"][0] == [k.name for k in frames[0].truth.keypoints]
    for split, short in SHORT.items():
        folder, of_split = root / about[short], [f for f in frames if f.split == split]
        assert sorted(p.name for p in folder.iterdir()) == [f"{f.number:06d}.png" for f in of_split]
        for frame in of_split:
            path = root / "labels" / short / f"{frame.number:06d}.txt"
            words = [float(word) for word in path.read_text().split()]
            assert len(words) == 5 + 3 * count
            W, H = frame.camera.width_px, frame.camera.height_px
            cx, cy, w, h = np.multiply(words[1:5], (W, H, W, H))
            np.testing.assert_allclose(
                (cx - w / 2, cy - h / 2, w, h), cv2.boundingRect(frame.mask), atol=1e-4
            )
            for k, (u, v, seen) in zip(frame.truth.keypoints, np.reshape(words[5:], (-1, 3)), strict=True):
                if seen:
                    np.testing.assert_allclose((u * W - 0.5, v * H - 0.5), k.pixel_px, atol=1e-4)


def test_yolo_folders_are_found_from_any_working_directory(everything, tmp_path, monkeypatch):
    """The rule of Ultralytics' `check_det_dataset`, its settings' folder empty; the set moved, too."""
    moved = tmp_path / "moved"
    shutil.copytree(everything / "yolo", moved)
    monkeypatch.chdir(tmp_path)
    for file in (everything / "yolo" / "data.yaml", moved / "data.yaml"):
        about = yaml.safe_load(file.read_text())
        root = tmp_path / "settings" / (about.get("path") or file.parent)  # an absolute folder stays itself
        for split in ("train", "val", "test"):
            pictures = list((root / about[split]).glob("*.png"))
            assert pictures
            for picture in pictures:  # labels are sought where "images" is replaced
                text = str(picture).replace("/images/", "/labels/").replace(".png", ".txt")
                assert (root / text).is_file()


class Files(dict):
    """Output of a writer that keeps the files by name."""

    write = dict.__setitem__


def yolo_folder(everything, splits, out, *, name="tango", keypoints=("a",)):
    """Write frames of some splits as YOLO-pose, for a target of any name; return the parsed ``data.yaml``."""
    card = read_card(everything)
    target = msgspec.structs.replace(
        card.target, name=name, keypoints=dict.fromkeys(keypoints, (0.0, 0.0, 0.0))
    )
    files = Files()
    writer = find_format("yolo").open_writer(files, msgspec.structs.replace(card, target=target))
    for k, split in enumerate(splits):
        writer.write(frame_from_folder(everything, k, split))
    writer.finish()
    for file, data in files.items():
        (out / file).parent.mkdir(parents=True, exist_ok=True)
        (out / file).write_bytes(data)
    return yaml.safe_load(files["data.yaml"])


def test_yolo_names_are_read_back_as_they_are(everything, tmp_path):
    keypoints = ["1", "on", "a, b", "c: d", "1e3", "~", "", "#", 'a"b', "\N{ROCKET}", "\x7f\u2028"]
    about = yolo_folder(everything, ["train"], tmp_path, name="no", keypoints=keypoints)
    assert about["names"] == {0: "no"}
    assert about["kpt_names"] == {0: keypoints}
    assert about["kpt_shape"] == [len(keypoints), 3]


@pytest.mark.parametrize(
    "splits",
    [[""], ["train"], ["validation"], ["test"], ["test", "validation"], ["train", "test"], list(SHORT)],
)
def test_yolo_names_only_folders_that_exist_and_always_train_and_val(everything, tmp_path, splits):
    about = yolo_folder(everything, splits, tmp_path)
    named = {key: about[key] for key in ("train", "val", "test") if key in about}
    assert {"train", "val"} <= set(named)
    assert all(list((tmp_path / folder).glob("*.png")) for folder in named.values())
    # a split that exists is never replaced
    own = {SHORT.get(split, "train") for split in splits}
    assert all(named[split] == f"images/{split}" for split in own)
    assert ("test" in named) == ("test" in own)
