"""Faults planted in the exports of a data set: check finds each by comparing the export with the native frames."""

import io
import itertools
import json
import shutil
import tarfile
from importlib.util import find_spec

import cv2
import numpy as np
import pytest
from small_flight import small_flight
from typer.testing import CliRunner

from flyaround.cli.app import app
from flyaround.simulator.dataset.capture import capture
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.dataset.check.exports import ExportsCheck
from flyaround.simulator.dataset.check.verify import check_dataset
from flyaround.simulator.dataset.formats.labelled_frame import frame_from_folder
from flyaround.simulator.dataset.formats.registry import writable
from flyaround.simulator.labels.request import LAYERS
from flyaround.simulator.labels.truth import read_truth
from flyaround.simulator.world.frames.pose import Pose

pytestmark = pytest.mark.gl

N = 11


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    """Return a data set in every format whose library is installed, of more frames than a check samples."""
    folder = tmp_path_factory.mktemp("exports") / "set"
    names = [name for name in writable() if name != "parquet" or find_spec("pyarrow")]
    assert (
        capture(
            small_flight(160, n=N), folder, formats=tuple(names), labels=LAYERS, split=(8, 2, 1)
        ).quarantined
        == ()
    )
    return folder


@pytest.fixture(scope="module")
def poses(original):
    truths = [read_truth(original / "images" / f"{k:06d}.json") for k in range(N)]
    return {
        k: Pose("camera", "target", t.q_camera_from_target_wxyz, t.t_camera_from_target_m)
        for k, t in enumerate(truths)
    }


@pytest.fixture
def folder(original, tmp_path):
    return shutil.copytree(original, tmp_path / "set")


def compare(folder, poses, *, whole=True, seed=1):
    check = ExportsCheck(folder, read_card(folder), sorted(poses), seed, whole=whole)
    for k in sorted(poses):
        check.take(frame_from_folder(folder, k, check.splits.get(k, "")))
    return check.finish(poses)


def faults(*args, **options):
    return compare(*args, **options).faults


@pytest.mark.parametrize("whole", [False, True])
def test_untouched_exports_have_no_fault(original, poses, whole):
    for seed in range(1 if whole else 2):
        found = compare(original, poses, seed=seed, whole=whole)
        assert found.faults == ()
        assert found.n_frames == N if whole else 4 <= found.n_frames < N
        assert found.not_checked == ()


def one_of(folder, pattern, place=0):
    return sorted(folder.glob(pattern))[place]


def cut(pattern):
    def spoil(folder):
        path = one_of(folder, pattern)
        path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])

    return spoil


def flip(pattern, *, byte):
    """Invert a byte, counted from the start or, if negative, from the end."""

    def spoil(folder):
        path = one_of(folder, pattern)
        data = bytearray(path.read_bytes())
        data[byte] ^= 0xFF
        path.write_bytes(data)

    return spoil


def remove(pattern):
    return lambda folder: one_of(folder, pattern).unlink()


def exchange(pattern):
    """Put another frame's file in the place of one."""

    def spoil(folder):
        shutil.copy(one_of(folder, pattern, 1), one_of(folder, pattern))

    return spoil


def edit(pattern, change):
    def spoil(folder):
        path = one_of(folder, pattern)
        document = json.loads(path.read_text())
        change(document)
        path.write_text(json.dumps(document))

    return spoil


def pixels(pattern, change):
    def spoil(folder):
        path = one_of(folder, pattern)
        cv2.imwrite(str(path), change(cv2.imread(str(path), cv2.IMREAD_UNCHANGED)))

    return spoil


def word(pattern, row, column, separator):
    """Change one number of a text file by one in a hundred."""

    def spoil(folder):
        path = one_of(folder, pattern)
        rows = path.read_text().splitlines()
        cells = rows[row].split(separator)
        cells[column] = repr(float(cells[column]) * 1.01)
        rows[row] = separator.join(cells)
        path.write_text("\n".join(rows) + "\n")

    return spoil


def array(name, change):
    def spoil(folder):
        path = one_of(folder, "npz/train/*.npz")
        arrays = dict(np.load(path))
        arrays[name] = change(arrays[name])
        np.savez_compressed(path, **arrays)

    return spoil


def member(ending):
    """Put the second frame's member of a shard in the place of the first's."""

    def spoil(folder):
        path = one_of(folder, "webdataset/train-*.tar")
        with tarfile.open(path) as tar:
            files = [(m.name, tar.extractfile(m).read()) for m in tar]
        first, second = [k for k, (name, _) in enumerate(files) if name.split(".", 1)[1] == ending][:2]
        files[first] = (files[first][0], files[second][1])
        with tarfile.open(path, "w", format=tarfile.USTAR_FORMAT) as tar:
            for name, data in files:
                info = tarfile.TarInfo(name)
                info.size = len(data)
                tar.addfile(info, io.BytesIO(data))

    return spoil


def exr(channel):
    def spoil(folder):
        import OpenEXR

        path = one_of(folder, "exr/train/*.exr")
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = {name: np.array(c.pixels) for name, c in file.channels().items()}
            header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        channels[channel] = channels[channel] * np.float32(1.01) + np.float32(0.1)
        OpenEXR.File(header, channels).write(str(path))

    return spoil


def swap_keypoints(document):
    k = document["annotations"][0]["keypoints"]
    k[0:3], k[3:6] = k[3:6], k[0:3]


PLANTED = {
    "speed: another frame's JPEG": exchange("speed/images/train/*.jpg"),
    "speed: JPEG cut": cut("speed/images/train/*.jpg"),
    "speed: JPEG missing": remove("speed/images/train/*.jpg"),
    "speed: JPEG lighter": pixels("speed/images/train/*.jpg", lambda x: cv2.add(x, 5)),
    "speed: position": edit("speed/train.json", lambda d: d[0]["r_Vo2To_vbs_true"].__setitem__(2, 9.0)),
    "speed: row missing": edit("speed/train.json", lambda d: d.pop(0)),
    "speed: rows exchanged": edit(
        "speed/train.json", lambda d: (d[0].update(filename=d[1]["filename"]), d.pop(1))
    ),
    "speed: list cut": cut("speed/train.json"),
    "speed: camera": edit("speed/camera.json", lambda d: d.update(fx=d["fx"] * 1.01)),
    "speedplus: another frame's JPEG": exchange("speedplus/synthetic/images/*.jpg"),
    "speedplus: quaternion": edit(
        "speedplus/synthetic/train.json", lambda d: d[0]["q_vbs2tango_true"].reverse()
    ),
    "spark: picture": exchange("spark/images/train/*.png"),
    "spark: position": word("spark/train.csv", 1, 2, ","),
    "spark: list cut": cut("spark/train.csv"),
    "urso: picture": exchange("urso/*_rgb.png"),
    "urso: pose": word("urso/train_poses_gt.csv", 1, 0, ","),
    "urso: names": lambda folder: (folder / "urso/train_images.csv").write_text(
        "\n".join(reversed((folder / "urso/train_images.csv").read_text().split())) + "\n"
    ),
    "bop: picture": exchange("bop/train/000000/gray/*.png"),
    "bop: mask": pixels("bop/train/000000/mask_visib/*.png", lambda x: np.roll(x, 2, axis=1)),
    "bop: depth": pixels("bop/train/000000/depth/*.png", lambda x: np.where(x > 0, x + 5, 0).astype(x.dtype)),
    "bop: depth missing": remove("bop/train/000000/depth/*.png"),
    "bop: pose": edit(
        "bop/train/000000/scene_gt.json", lambda d: d["0"][0]["cam_t_m2c"].__setitem__(0, 77.0)
    ),
    "bop: scale": edit("bop/train/000000/scene_camera.json", lambda d: d["0"].update(depth_scale=2.0)),
    "bop: box": edit("bop/train/000000/scene_gt_info.json", lambda d: d["0"][0]["bbox_obj"].reverse()),
    "bop: diameter": edit("bop/models/models_info.json", lambda d: d["1"].update(diameter=1.0)),
    "bop: model": cut("bop/models/*.ply"),
    "coco: picture": exchange("coco/images/train/*.png"),
    "coco: box": edit("coco/annotations/train.json", lambda d: d["annotations"][0]["bbox"].reverse()),
    "coco: keypoints": edit("coco/annotations/train.json", swap_keypoints),
    "coco: order of keypoints": edit(
        "coco/annotations/train.json", lambda d: d["categories"][0]["keypoints"].reverse()
    ),
    "coco: mask": edit(
        "coco/annotations/train.json", lambda d: d["annotations"][0]["segmentation"]["counts"].reverse()
    ),
    "coco: image's file": edit(
        "coco/annotations/train.json", lambda d: d["images"][0].update(file_name="000001.png")
    ),
    "coco: annotation missing": edit("coco/annotations/train.json", lambda d: d["annotations"].pop(0)),
    "coco: annotation twice": edit(
        "coco/annotations/train.json", lambda d: d["annotations"].append(d["annotations"][0])
    ),
    "coco: parts' class": edit(
        "coco/annotations/train_parts.json", lambda d: d["annotations"][0].update(category_id=9)
    ),
    "coco: polygon": edit(
        "coco/annotations/train_polygons.json",
        lambda d: d["annotations"][0]["segmentation"][0].__setitem__(0, 1.0),
    ),
    "coco: key twice": lambda folder: one_of(folder, "coco/annotations/train.json").write_text(
        one_of(folder, "coco/annotations/train.json").read_text().replace("{", '{"images": [],', 1)
    ),
    "yolo: picture": exchange("yolo/images/train/*.png"),
    "yolo: box": word("yolo/labels/train/*.txt", 0, 1, " "),
    "yolo: keypoint": word("yolo/labels/train/*.txt", 0, 5, " "),
    "yolo: label of another frame": exchange("yolo/labels/train/*.txt"),
    "yolo: label empty": lambda folder: one_of(folder, "yolo/labels/train/*.txt").write_text(""),
    "npz: mask": array("mask", lambda x: np.roll(x, 2, axis=0)),
    "npz: pose": array("t_camera_from_target_m", lambda x: x * 1.001),
    "npz: order of keypoints": array("keypoints_name", lambda x: x[::-1]),
    "npz: depth": array("depth", lambda x: x + np.float32(0.05)),
    "npz: cut": cut("npz/train/*.npz"),
    "exr: depth": exr("depth.Z"),
    "exr: record": exchange("exr/train/*.json"),
    "exr: cut": cut("exr/train/*.exr"),
    "webdataset: picture": member("png"),
    "webdataset: depth": member("depth.exr"),
    "webdataset: cut": cut("webdataset/train-*.tar"),
    "mcap: cut": cut("mcap/train-*.mcap"),
    "mcap: byte of a chunk": flip("mcap/train-*.mcap", byte=3000),
    "mcap: byte of a length": flip("mcap/train-*.mcap", byte=102),
    "mcap: first byte": flip("mcap/train-*.mcap", byte=0),
    "mcap: another split's": lambda folder: shutil.copy(
        one_of(folder, "mcap/test-*.mcap"), one_of(folder, "mcap/train-*.mcap")
    ),
}


def table(change):
    """Change the rows of a Parquet file; its schema stays."""

    def spoil(folder):
        parquet = pytest.importorskip("pyarrow.parquet", reason="format parquet needs pyarrow")
        path = one_of(folder, "parquet/data/train-*.parquet")
        there = parquet.read_table(path)
        rows = there.to_pylist()
        change(rows)
        parquet.write_table(type(there).from_pylist(rows, schema=there.schema), path)

    return spoil


PARQUET = {
    "another frame's picture": table(lambda rows: rows[0].update(image=rows[1]["image"])),
    "another frame's mask": table(lambda rows: rows[0]["mask"].update(bytes=rows[1]["mask"]["bytes"])),
    "name of the picture": table(lambda rows: rows[0]["image"].update(path="000001.png")),
    "box": table(lambda rows: rows[0]["box_px"].reverse()),
    "quaternion": table(lambda rows: rows[0]["q_camera_from_target_wxyz"].reverse()),
    "position": table(lambda rows: rows[0]["t_camera_from_target_m"].__setitem__(2, 9.0)),
    "order of keypoints": table(lambda rows: rows[0]["keypoints_name"].reverse()),
    "keypoint's pixel": table(lambda rows: rows[0]["keypoints_pixel_px"][0].reverse()),
    "camera": table(lambda rows: rows[0]["camera_matrix"].__setitem__(0, 1.0)),
    "feasible": table(lambda rows: rows[0].update(feasible=not rows[0]["feasible"])),
    "no depth": table(lambda rows: rows[0].update(depth_file=None)),
    "another frame's record": table(lambda rows: rows[0].update(truth_json=rows[1]["truth_json"])),
    "row lost": table(lambda rows: rows.pop(0)),
    "row twice": table(lambda rows: rows.append(rows[0])),
    "cut": cut("parquet/data/train-*.parquet"),
    "shard lost": remove("parquet/data/train-*.parquet"),
}


@pytest.fixture
def parquet_alone(original, tmp_path):
    """Return the data set with no other export."""
    pytest.importorskip("pyarrow", reason="format parquet needs pyarrow")
    others = [name for name in writable() if name not in ("native", "parquet")]
    folder = shutil.copytree(original, tmp_path / "set", ignore=shutil.ignore_patterns(*others))
    edit("dataset.json", lambda d: d.update(formats=["native", "parquet"]))(folder)
    return folder


@pytest.mark.parametrize("kind", PARQUET)
def test_faults_planted_in_parquet_are_found(parquet_alone, poses, kind):
    folder = parquet_alone
    PARQUET[kind](folder)
    found = [what for _, what in faults(folder, poses)]
    assert found
    assert all(what.startswith("parquet/data/train-00000.parquet: ") for what in found)


def rounds():
    """Return the planted faults in groups of one for each format, which one comparison finds."""
    by_format = {}
    for kind in PLANTED:
        by_format.setdefault(kind.split(":")[0], []).append(kind)
    return [[k for k in group if k] for group in itertools.zip_longest(*by_format.values())]


@pytest.mark.parametrize("kinds", rounds(), ids=lambda kinds: f"{len(kinds)} faults as {kinds[0]}")
def test_planted_faults_are_found(folder, poses, kinds):
    for kind in kinds:
        PLANTED[kind](folder)
    found = faults(folder, poses)
    missed = [
        kind for kind in kinds if not any(what.startswith(f"{kind.split(':')[0]}/") for _, what in found)
    ]
    assert missed == []
    touched = {kind.split(":")[0] for kind in kinds}
    assert {what.split("/")[0] for _, what in found} == touched


def test_formats_that_the_card_does_not_name_and_folders_that_are_missing_are_found(folder, poses):
    edit("dataset.json", lambda d: d["formats"].remove("bop"))(folder)
    shutil.rmtree(folder / "yolo")
    found = [what for _, what in faults(folder, poses, whole=False) if not what.startswith("webdataset/")]
    assert "bop/ exists, but the card does not name that format" in found
    assert all(what.startswith(("bop/", "yolo/")) for what in found)
    assert len(found) > N


@pytest.mark.parametrize("change", [remove, cut])
def test_files_of_frames_that_are_not_sampled_must_be_whole(folder, poses, change):
    for pattern in ("speed/images/train/*.jpg", "coco/images/train/*.png"):
        change(pattern)(folder)
    for seed in range(2):
        found = faults(folder, poses, whole=False, seed=seed)
        assert {what.split("/")[0] for _, what in found} == {"speed", "coco"}


def test_poses_of_frames_that_are_not_sampled_are_compared(folder, poses):
    edit("speed/train.json", lambda d: [row["r_Vo2To_vbs_true"].__setitem__(2, 33.0) for row in d])(folder)
    of_train = json.loads((folder / "split.json").read_text())["train"]
    assert {k for k, _ in faults(folder, poses, whole=False)} == set(of_train)


@pytest.mark.parametrize("wrong_first", [False, True])
@pytest.mark.parametrize("name", ["speed", "spark", "urso"])
def test_a_second_row_of_a_frame_in_a_pose_list_is_found_for_every_sample(folder, poses, name, wrong_first):
    split = json.loads((folder / "split.json").read_text())
    k = split["train"][-1]
    if name == "speed":
        path = folder / "speed/train.json"
        rows = json.loads(path.read_text())
        place = next(i for i, row in enumerate(rows) if row["filename"] == f"img{k:06d}.jpg")
        wrong = rows[place] | {"r_Vo2To_vbs_true": [0.0, 0.0, 33.0]}
        rows.insert(place if wrong_first else place + 1, wrong)
        path.write_text(json.dumps(rows))
        lists = ["train.json"]
    else:
        lists = ["train.csv"] if name == "spark" else ["train_images.csv", "train_poses_gt.csv"]
        for file in lists:
            path = folder / name / file
            lines = path.read_text().splitlines()
            lines.append(lines[-1])
            path.write_text("\n".join(lines) + "\n")
    for seed in range(2):
        found = faults(folder, poses, whole=False, seed=seed)
        assert any(
            frame == k and f"{name}/{lists[-1]}: the frame is listed a second time" == what
            for frame, what in found
        )


def test_wrong_and_missing_poses_are_reported_with_their_list(folder, poses):
    train = json.loads((folder / "split.json").read_text())["train"]
    path = folder / "speed/train.json"
    rows = json.loads(path.read_text())
    k, lost = train[0], train[1]
    for row in rows:
        if row["filename"] == f"img{k:06d}.jpg":
            row["r_Vo2To_vbs_true"][2] = 33.0
    path.write_text(json.dumps([row for row in rows if row["filename"] != f"img{lost:06d}.jpg"]))
    found = faults(folder, poses, whole=False)
    assert (k, "speed/train.json: the pose differs from that of the native frame") in found
    assert (lost, "speed/: no list has a pose of the frame") in found


def test_a_split_whose_frames_are_all_lost_is_reported_as_missing_files(folder):
    for path in (folder / "images").iterdir():
        path.unlink()
    found = check_dataset(folder, redraw=0).faults
    assert [fault.frame for fault in found if fault.what == "files are missing"] == list(range(N))


def test_check_tells_of_exports(folder):
    PLANTED["coco: box"](folder)
    result = CliRunner().invoke(app, ["check", str(folder), "--redraw", "0", "--all", "--json"])
    report = json.loads(result.stdout)
    assert result.exit_code == 1
    assert report["exported"] == N
    assert [f["what"] for f in report["faults"]] == [
        "coco/annotations/train.json: annotations 1 is not the native frame's"
    ]


def test_exports_of_another_version_are_said_not_to_be_compared(folder):
    edit("dataset.json", lambda d: d["machine"].update(flyaround="0.0.1"))(folder)
    report = check_dataset(folder, redraw=0)
    assert report.faults == ()
    assert any("flyaround 0.0.1" in reason for reason in report.not_checked)
