"""Each format read back by a reader written from its public page, beside the native records."""

import csv
import dataclasses
import json
import math
import shutil
import tarfile
from types import SimpleNamespace

import cv2
import numpy as np
import OpenEXR
import pytest
from scipy.spatial.transform import Rotation

import flyaround as fa
from flyaround.__main__ import run
from flyaround.simulator.camera.lens.camera_model import Distortion
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.dataset.check.verify import check_dataset
from flyaround.simulator.dataset.formats.coco import CocoWriter
from flyaround.simulator.dataset.formats.registry import formats, read_foreign, writable
from flyaround.simulator.dataset.formats.ros_messages import camera_info
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.truth import read_truth

pytestmark = pytest.mark.gl

SPLITS = ("train", "validation", "test")
SHORT = {"train": "train", "validation": "val", "test": "test"}


@pytest.fixture(scope="module")
def frames(everything):
    return list(fa.open_dataset(everything))


def of(frames, split):
    return [f for f in frames if f.split == split]


def rotation(frame):
    w, x, y, z = frame.truth.q_camera_from_target_wxyz
    return Rotation.from_quat([x, y, z, w]).as_matrix()


def test_every_format_has_its_folder_and_the_set_has_no_fault(everything):
    card = read_card(everything)
    assert set(card.formats) <= set(writable())
    assert {p.name for p in everything.iterdir() if p.is_dir()} == {
        "images" if name == "native" else name for name in card.formats
    }
    assert check_dataset(everything, redraw=0).faults == ()
    split = json.loads((everything / "split.json").read_text())
    assert split["ratio"] == [4, 1, 1]
    assert [len(split[name]) for name in SPLITS] == [4, 1, 1]


def test_speed_and_speedplus(everything, frames):
    """https://kelvins.esa.int/satellite-pose-estimation-challenge/data/, https://purl.stanford.edu/wv398fc4383."""
    for name, key, lists, images in (
        ("speed", "q_vbs2tango", ".", "images/{}"),
        ("speedplus", "q_vbs2tango_true", "synthetic", "synthetic/images"),
    ):
        root = everything / name
        camera = json.loads((root / "camera.json").read_text())
        assert camera["Nu"] == 384
        assert (camera["fx"] / camera["ppx"], camera["fy"] / camera["ppy"]) == pytest.approx(
            (frames[0].camera.fx_px, frames[0].camera.fy_px)
        )
        assert (camera["fx_px"], camera["fy_px"]) == (frames[0].camera.fx_px, frames[0].camera.fy_px)
        for split in SPLITS:
            rows = json.loads((root / lists / f"{split}.json").read_text())
            assert [r["filename"] for r in rows] == [f"img{f.number:06d}.jpg" for f in of(frames, split)]
            for row, frame in zip(rows, of(frames, split), strict=True):
                assert tuple(row[key]) == frame.truth.q_camera_from_target_wxyz
                assert tuple(row["r_Vo2To_vbs_true"]) == frame.truth.t_camera_from_target_m
                image = cv2.imread(str(root / images.format(split) / row["filename"]), cv2.IMREAD_UNCHANGED)
                assert image.ndim == 2
                assert np.abs(image.astype(float) - frame.image).mean() < 2.5


def test_urso(everything, frames):
    """The loader of its authors: x is the depth, y / x and z / x the place, image y against z; scalar last."""
    root = everything / "urso"
    for split in SPLITS:
        names = (root / f"{SHORT[split]}_images.csv").read_text().split()
        rows = list(csv.DictReader((root / f"{SHORT[split]}_poses_gt.csv").read_text().splitlines()))
        for name, row, frame in zip(names, rows, of(frames, split), strict=True):
            assert (cv2.imread(str(root / name), cv2.IMREAD_UNCHANGED) == frame.image).all()
            x, y, z, *q = (float(row[c]) for c in ("x", "y", "z", "q1", "q2", "q3", "q4"))
            c = frame.camera
            place = (c.cx_px + c.fx_px * y / x, c.cy_px - c.fy_px * z / x)
            np.testing.assert_allclose(place, c.project(frame.pose.t_m), atol=1e-9)
            # a point of the mirrored model is seen where ours is
            R, point = Rotation.from_quat(q).as_matrix(), np.array([0.2, 0.3, -0.1])
            there = R @ (point * [1, -1, 1]) + (x, y, z)
            np.testing.assert_allclose([there[1], -there[2], there[0]], frame.pose.apply(point), atol=1e-12)


def test_spark(everything, frames):
    """https://cvi2.uni.lu/spark2022: Tx Ty Tz in metres, Qx Qy Qz Qw of the craft in the camera."""
    root = everything / "spark"
    for split in SPLITS:
        rows = list(csv.DictReader((root / f"{SHORT[split]}.csv").read_text().splitlines()))
        for row, frame in zip(rows, of(frames, split), strict=True):
            assert (root / "images" / SHORT[split] / row["filename"]).is_file()
            q = [float(row[f"Q{a}"]) for a in "xyzw"]
            np.testing.assert_allclose(Rotation.from_quat(q).as_matrix(), rotation(frame), atol=1e-12)
            assert tuple(float(row[f"T{a}"]) for a in "xyz") == frame.truth.t_camera_from_target_m


def test_bop(everything, frames):
    """https://github.com/thodan/bop_toolkit/blob/master/docs/bop_datasets_format.md."""
    root = everything / "bop"
    ply = (root / "models" / "obj_000001.ply").read_bytes()
    head, body = ply.split(b"end_header\n", 1)
    assert b"binary_little_endian" in head
    count = int(next(line for line in head.split(b"\n") if line.startswith(b"element vertex")).split()[-1])
    assert [line for line in head.split(b"\n") if b"property" in line][:3] == [
        b"property float x",
        b"property float y",
        b"property float z",
    ]
    points = np.frombuffer(body, "<f4", 3 * count).reshape(-1, 3)
    info = json.loads((root / "models" / "models_info.json").read_text())["1"]
    np.testing.assert_allclose([info[f"min_{a}"] for a in "xyz"], points.min(axis=0), atol=1e-3)
    np.testing.assert_allclose([info[f"size_{a}"] for a in "xyz"], np.ptp(points, axis=0), atol=1e-3)
    assert math.dist(*points[[points[:, 0].argmin(), points[:, 0].argmax()]]) <= info["diameter"] + 1e-3
    assert 800 < info["diameter"] < 2000  # millimetres
    for split in SPLITS:
        whole = json.loads((root / "camera.json").read_text())
        scene = root / SHORT[split] / "000000"
        gt, gt_info, cameras = (
            json.loads((scene / f"scene_{name}.json").read_text()) for name in ("gt", "gt_info", "camera")
        )
        assert list(gt) == [str(f.number) for f in of(frames, split)]
        for frame in of(frames, split):
            key = str(frame.number)
            (one,), (about,) = gt[key], gt_info[key]
            R, t = np.array(one["cam_R_m2c"]).reshape(3, 3), np.array(one["cam_t_m2c"])
            K = np.array(cameras[key]["cam_K"]).reshape(3, 3)
            assert K.tolist() == [[whole["fx"], 0, whole["cx"]], [0, whole["fy"], whole["cy"]], [0, 0, 1]]
            seen = points @ R.T + t
            pixels = (seen / seen[:, 2:]) @ K.T
            np.testing.assert_allclose(pixels[:, 0].min(), frame.truth.box_amodal_px[0], atol=2e-3)
            np.testing.assert_allclose(pixels[:, 1].max(), frame.truth.box_amodal_px[3], atol=2e-3)
            mask = cv2.imread(
                str(scene / "mask_visib" / f"{frame.number:06d}_000000.png"), cv2.IMREAD_UNCHANGED
            )
            x, y, width, height = cv2.boundingRect(mask)
            assert tuple(about["bbox_visib"]) == (x, y, width - 1, height - 1)  # the toolkit's calc_2d_bbox
            assert np.count_nonzero(mask) == about["px_count_visib"] > 100
            depth = cv2.imread(str(scene / "depth" / f"{frame.number:06d}.png"), cv2.IMREAD_UNCHANGED)
            metres = depth * cameras[key]["depth_scale"] / 1e3
            on = mask > 0
            np.testing.assert_allclose(metres[on], frame.layer("depth")[on], atol=6e-4)
            assert not depth[~on].any()
            assert (scene / "gray" / f"{frame.number:06d}.png").is_file()


def decoded(runs):
    """COCO's uncompressed run lengths, by the definition."""
    flat, value = [], 0
    for count in runs["counts"]:
        flat += [value] * count
        value = 1 - value
    return np.array(flat).reshape(runs["size"][::-1]).T


@pytest.mark.parametrize("where", [(0, 0), (3, 2), (7, 5), (4, 0), (0, 3)])
def test_run_lengths_of_any_place(where):
    """Also where the mask begins with the first pixel, ends with the last, or fills whole columns."""
    from flyaround.simulator.dataset.formats.coco import polygons, run_lengths

    mask = np.zeros((6, 9), np.uint8)
    x, y = where
    mask[y : y + 2, x : x + 3] = 255
    assert (decoded(run_lengths(mask)) == (mask > 0)).all()
    mask[:, x] = 1
    assert (decoded(run_lengths(mask)) == (mask > 0)).all()
    assert sum(run_lengths(mask)["counts"]) == mask.size
    assert len(polygons(mask)) == 1
    assert run_lengths(mask * 0) == {"size": [6, 9], "counts": [54]}
    assert polygons(mask * 0) == []
    assert (decoded(run_lengths(mask * 0 + 1)) == 1).all()


def test_speed_keeps_colour():
    from flyaround.simulator.dataset.formats.labelled_frame import LabelledFrame
    from flyaround.simulator.dataset.formats.native import encode_png
    from flyaround.simulator.dataset.formats.speed_writer import jpeg

    image = np.zeros((40, 60, 3), np.uint8)
    image[10:30, 20:40] = (200, 40, 90)
    data = jpeg(LabelledFrame(7, {"png": encode_png(image)}.__getitem__))
    seen = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)[20, 30, ::-1]
    np.testing.assert_allclose(seen, (200, 40, 90), atol=12)


def test_coco(everything, frames):
    """https://cocodataset.org/#format-data and #format-results."""
    root = everything / "coco"
    states = set()
    for split in SPLITS:
        found, outlines, parts = (
            json.loads((root / "annotations" / f"{split}{end}.json").read_text())
            for end in ("", "_polygons", "_parts")
        )
        names = found["categories"][0]["keypoints"]
        classes = {c["id"]: c["name"] for c in parts["categories"]}
        assert found["categories"][0]["id"] not in classes
        for frame, image, one, other in zip(
            of(frames, split), found["images"], found["annotations"], outlines["annotations"], strict=True
        ):
            assert (root / "images" / split / image["file_name"]).is_file()
            assert (decoded(one["segmentation"]) == (frame.mask > 0)).all()
            x, y, w, h = one["bbox"]
            assert (x, y, w, h) == cv2.boundingRect(frame.mask)
            assert one["area"] == np.count_nonzero(frame.mask)
            assert all(len(p) >= 6 for p in other["segmentation"])
            xy = np.concatenate([np.reshape(p, (-1, 2)) for p in other["segmentation"]])
            np.testing.assert_allclose(xy.min(axis=0), (x + 0.25, y + 0.25))
            np.testing.assert_allclose(xy.max(axis=0), (x + w - 0.25, y + h - 0.25))
            triples = np.reshape(one["keypoints"], (-1, 3))
            assert one["num_keypoints"] == np.count_nonzero(triples[:, 2])
            for k, name, (u, v, seen) in zip(frame.truth.keypoints, names, triples, strict=True):
                assert k.name == name
                wanted = {"out_of_frame": 0, "visible": 2}.get(k.state, 1)
                states.add(k.state)
                assert seen == wanted
                if wanted:
                    np.testing.assert_allclose((u, v), np.add(k.pixel_px, 0.5))
            layer = frame.layer("parts")
            of_frame = [a for a in parts["annotations"] if a["image_id"] == frame.number]
            assert sum(a["area"] for a in of_frame) == np.count_nonzero(layer)
            of_part = read_card(everything).target.part_classes
            for a in of_frame:
                numbers = {n for n, c in enumerate(of_part, start=1) if c == classes[a["category_id"]]}
                assert (decoded(a["segmentation"]) == np.isin(layer, list(numbers))).all()
    assert len(states) > 1


def test_coco_refuses_a_part_that_the_card_does_not_name():
    def written(*numbers):
        target = SimpleNamespace(part_classes=("body", "antenna"))
        writer = CocoWriter(None, SimpleNamespace(target=target))
        parts = np.array([numbers], np.uint16)
        return writer._parts_of(SimpleNamespace(where="000003", number=3, layer=lambda _name: parts))

    assert sorted(a["area"] for a in written(0, 1, 2, 2)) == [1, 2]
    with pytest.raises(UserError, match="000003: part 7 has no class among the 2 of the card"):
        written(0, 1, 2, 7)


def test_webdataset_is_the_native_files(everything, frames):
    for split in SPLITS:
        with tarfile.open(everything / "webdataset" / f"{split}-000000.tar") as tar:
            members = tar.getmembers()
            assert all(m.mtime == 0 for m in members)
            names = {m.name for m in members}
            native = {
                p.name for f in of(frames, split) for p in (everything / "images").glob(f"{f.number:06d}.*")
            }
            assert names == native
            for m in members:
                assert tar.extractfile(m).read() == (everything / "images" / m.name).read_bytes()


def test_npz_and_exr(everything, frames):
    for frame in frames:
        stem = f"{frame.split}/{frame.number:06d}"
        with np.load(everything / "npz" / f"{stem}.npz") as arrays:
            assert (arrays["image"] == frame.image).all()
            np.testing.assert_array_equal(arrays["depth"], frame.layer("depth"))
            assert arrays["keypoints_state"].tolist() == [k.state for k in frame.truth.keypoints]
            np.testing.assert_array_equal(arrays["camera_matrix"], frame.camera.K)
        channels = OpenEXR.File(str(everything / "exr" / f"{stem}.exr"), separate_channels=True).channels()
        assert (channels["Y"].pixels == frame.image).all()
        np.testing.assert_array_equal(channels["depth.Z"].pixels, frame.layer("depth"))
        assert (channels["parts.Y"].pixels == frame.layer("parts")).all()
        assert {"mask", "normals.X", "clean.Y"} <= set(channels)
        assert read_truth(everything / "exr" / f"{stem}.json") == frame.truth


def test_mcap_is_read_by_rosbags(everything, frames):
    from rosbags.highlevel import AnyReader

    for split in SPLITS:
        bag = everything / "mcap" / f"{split}-00000.mcap"
        found = {}
        with AnyReader([bag]) as reader:
            for connection, _time, raw in reader.messages():
                message = reader.deserialize(raw, connection.msgtype)
                found.setdefault(connection.topic, []).append(message)
        for k, frame in enumerate(of(frames, split)):
            image = cv2.imdecode(found["/camera/image_raw/compressed"][k].data, cv2.IMREAD_UNCHANGED)
            assert (image == frame.image).all()
            pose = found["/truth/pose"][k].pose
            w, x, *_ = frame.truth.q_camera_from_target_wxyz
            assert (pose.orientation.w, pose.orientation.x) == (w, x)
            assert pose.position.z == frame.truth.t_camera_from_target_m[2]
            assert found["/camera/camera_info"][k].k[0] == frame.camera.fx_px
            assert json.loads(found["/truth/record"][k].data)["frame_index"] == frame.number


@pytest.mark.parametrize("form", ["speed", "speedplus", "urso", "spark"])
def test_what_is_written_is_read_again(everything, frames, form, tmp_path):
    place = everything / form
    lists = {
        "speed": "train.json",
        "speedplus": "synthetic/train.json",
        "urso": "train_poses_gt.csv",
        "spark": "train.csv",
    }
    found, name = read_foreign(place / lists[form])
    assert name == form
    for picture, frame in zip(found.pictures, of(frames, "train"), strict=True):
        np.testing.assert_allclose(picture.camera_from_target.R, rotation(frame), atol=1e-9)
        np.testing.assert_allclose(picture.camera_from_target.t_m, frame.pose.t_m, atol=1e-12)
    out = tmp_path / "out"
    assert run(["convert", str(place / lists[form]), "-o", str(out), "--target", "tango@low"]) == 0
    for again, frame in zip(fa.open_dataset(out), of(frames, "train"), strict=True):
        for name in ("fx_px", "fy_px", "cx_px", "cy_px"):
            assert getattr(again.camera, name) == pytest.approx(getattr(frame.camera, name), rel=1e-12)
        # by the model alone, less than an outline apart from what was drawn
        apart = np.count_nonzero(again.mask != frame.mask)
        assert apart < 0.03 * np.count_nonzero(frame.mask)


def test_conversion_writes_what_capture_writes(everything, tmp_path):
    for form in ("coco", "webdataset", "bop"):
        out = tmp_path / form
        assert run(["convert", str(everything), "-o", str(out), "--format", form]) == 0
        beside = everything / form
        files = sorted(p.relative_to(beside) for p in beside.rglob("*") if p.is_file())
        made = {p.relative_to(out) for p in out.rglob("*") if p.is_file()}
        assert {str(p) for p in made - set(files)} == {"run.toml"}
        assert made >= set(files)
        for name in files:
            if name.name != "dataset.json":  # the card says by then that the set is complete
                assert (out / name).read_bytes() == (beside / name).read_bytes(), name


def test_resume_and_two_workers_give_the_same_exports(everything, small_plan, tmp_path):
    from flyaround.simulator.dataset.capture import capture
    from flyaround.simulator.labels.request import LAYERS

    chosen = ("speed", "coco", "yolo", "webdataset")
    half = tmp_path / "half"
    shutil.copytree(everything / "images", half / "images")
    for k in (1, 4):
        (half / "images" / f"{k:06d}.json").unlink()
    card = json.loads((everything / "dataset.json").read_text())
    card["formats"], card["complete"] = ["native"], False
    (half / "dataset.json").write_text(json.dumps(card))
    capture(small_plan(), half, formats=chosen, labels=LAYERS, resume=True, workers=2)
    assert (half / "split.json").read_bytes() == (everything / "split.json").read_bytes()
    for form in chosen:
        for path in (everything / form).rglob("*"):
            if path.is_file() and path.name != "dataset.json":
                assert (half / path.relative_to(everything)).read_bytes() == path.read_bytes(), path


def test_what_a_format_cannot_hold_is_refused_before_anything_is_drawn(tmp_path, capsys):
    out = tmp_path / "out"

    def told(*options):
        assert run(["capture", "eval-black", "-n", "1", "-o", str(out), *options]) == 2
        assert not out.exists()
        return capsys.readouterr().err

    assert "lens distorts (brown_conrady)" in told("--format", "bop", "--camera", "speedplus")
    assert "fish-eye (kannala_brandt)" in told("--format", "speed", "--camera", "fisheye-140")
    assert "format shirt can only be read" in told("--format", "shirt")
    assert "unknown data-set format 'cocoa' in --format; choose from native, speed" in told(
        "--format", "cocoa"
    )
    assert "three whole numbers train:validation:test" in told("--split", "8:1")
    assert "three whole numbers" in told("--split", "0:0:0")


def test_conversions_that_mean_nothing_are_told(everything, tmp_path, capsys):
    full = tmp_path / "full"
    full.mkdir()
    (full / "mine.txt").write_text("mine")

    def told(*options):
        assert run(["convert", str(everything), *options]) == 2
        return capsys.readouterr().err

    assert "native data set already" in told("-o", str(tmp_path / "a"))
    assert "is not empty" in told("-o", str(full), "--format", "coco")
    assert [p.name for p in full.iterdir()] == ["mine.txt"]
    assert "leave out --target" in told("-o", str(tmp_path / "a"), "--format", "coco", "--target", "tango")


def test_each_format_says_what_it_holds(everything):
    card = read_card(everything)
    for name, form in formats().items():
        assert form.name == name
        if form.writer is not None:
            assert form.sentence(card).startswith(f"{name} holds ")


def test_camera_info_projects_as_the_camera_does(draw_kit):
    """By the message's definition: K and D make the raw image, P the rectified one."""
    camera = draw_kit.lens_camera
    info = camera_info(camera, "2026-03-01T12:00:00.000Z")
    K, P = np.reshape(info["k"], (3, 3)), np.reshape(info["p"], (3, 4))
    points = np.array([[0.3, 0.2, 4.0], [-0.5, 0.4, 5.0], [0.1, -0.3, 3.0]])
    raw, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, np.array(info["d"]))
    assert raw[:, 0] == pytest.approx(camera.project(points), abs=1e-9)
    rectified = np.concatenate([points, np.ones((3, 1))], axis=1) @ P.T
    straight = dataclasses.replace(camera, distortion=Distortion())
    assert rectified[:, :2] / rectified[:, 2:] == pytest.approx(straight.project(points), abs=1e-9)
    assert np.reshape(info["r"], (3, 3)).tolist() == np.eye(3).tolist()
    assert (info["width"], info["height"]) == (320, 240)
