"""Light fitted to pictures: our own under known boxes as the pictures of others."""

import json
from dataclasses import replace

import cv2
import msgspec
import numpy as np
import pytest

from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.compare.references import Reference, read_references, resize_camera
from flyaround.simulator.imaging.image_formation import digitise_scene, expose_scene
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.frames.pose import Pose
from flyaround.simulator.world.frames.rotation import quat_from_rotvec
from tools.studies.fitted_light.__main__ import main
from tools.studies.fitted_light.fit import (
    candidate_lights,
    scene_at_pose,
)
from tools.studies.fitted_light.pairs import check_pictures

TARGET = "tango-mockup@low"
STRONG = {40: 900.0, 33: 400.0}
"""Radiance of the candidates that light the picture [W m-2 sr-1]."""


@pytest.fixture(scope="module")
def pictures(renderer, tmp_path_factory):
    """A folder of two pictures under known boxes, SPEED's list beside it, and the references."""
    folder, target = tmp_path_factory.mktemp("pictures"), load_target(TARGET)
    camera, rows, references = resize_camera(load_camera("speed"), 480, 300), [], []
    for k, turn in enumerate([(0.4, 2.2, 0.3), (2.0, 0.5, -0.8)]):
        pose = Pose("camera", "target", quat_from_rotvec(np.array(turn)), (0.1, -0.05, 4.0))
        path = folder / f"img{k}.png"
        scene = scene_at_pose(Reference(path, np.zeros((300, 480), np.uint8), camera, pose), target)
        boxes = candidate_lights(scene)
        lights = tuple(
            msgspec.structs.replace(boxes[n], radiance_w_m2_sr=radiance) for n, radiance in STRONG.items()
        )
        scene = replace(scene, lights=lights)
        image = digitise_scene(scene, expose_scene(scene, renderer.render(scene, target).radiance))
        cv2.imwrite(str(path), image)
        references.append(Reference(path, np.asarray(image, np.uint8), camera, pose))
        q, t = pose.q_wxyz, pose.t_m
        rows.append({"filename": path.name, "q_vbs2tango": list(q), "r_Vo2To_vbs_true": list(t)})
    (folder / "poses.json").write_text(json.dumps(rows))
    return folder, references


@pytest.mark.slow
@pytest.mark.gl
def test_the_program_writes_a_page(pictures, tmp_path):
    folder, out = pictures[0], tmp_path / "page"
    words = [str(folder), "--poses", str(folder / "poses.json"), "--camera", "speed", "--target", TARGET]
    assert main([*words, "-o", str(out), "-n", "1"]) == 0
    assert json.loads((out / "fit.json").read_text())["summary"]["all_ncc"] > 0.9
    assert (out / "index.html").is_file()


def test_what_cannot_be_fitted_is_told_before_anything_is_written(tmp_path, capsys):
    folder, out, labels = tmp_path / "pictures", tmp_path / "page", tmp_path / "poses.json"
    folder.mkdir()
    row = {"filename": "a.png", "q_vbs2tango_true": [1, 0, 0, 0], "r_Vo2To_vbs_true": [0, 0, 5]}
    grey = np.random.default_rng(1).integers(0, 90, (60, 96)).astype(np.uint8)

    def told(rows, image=grey, *more, at=folder):
        labels.write_text(rows if isinstance(rows, str) else json.dumps(rows))
        cv2.imwrite(str(folder / "a.png"), image)
        assert main([str(at), "--poses", str(labels), "-o", str(out), *more]) == 2
        assert not out.exists()
        error = capsys.readouterr().err.strip()
        assert "Traceback" not in error
        return " ".join(error.split())

    assert "1 of 1 images have no pose, for example a.png" in told([])
    assert "2 of 2 images have no pose" in told([], grey, at=two_pictures(tmp_path / "two", grey))
    assert "entry 1 has no pose" in told([{"filename": "a.png"}])
    assert "entry 2 has no pose" in told([row, 7])
    assert "is not a list of poses" in told({})
    assert "is not JSON" in told("[")
    assert "nests more than 64 brackets" in told("[" * 1000)
    assert "length is 2" in told([row | {"q_vbs2tango_true": [2, 0, 0, 0]}])
    assert "not in front of the camera" in told([row | {"r_Vo2To_vbs_true": [0, 0, -5]}])
    # another camera
    assert "another aspect ratio than the camera's 1920 x 1200" in told(
        [row], grey[:, :60], "--camera", "speedplus"
    )
    # colour, but for a mark of some pixels
    coloured = np.dstack([grey, grey // 2, grey // 3])
    assert "is in colour" in told([row], coloured)
    marked = np.dstack([grey] * 3)
    marked[5, 7] = (255, 0, 0)
    cv2.imwrite(str(folder / "a.png"), marked)
    camera = load_camera("speed")
    check_pictures(read_references(folder, camera, 1, write(labels, [row])), camera)
    nowhere = told([row], grey, at=tmp_path / "nowhere")
    assert "there is no folder" in nowhere
    empty = tmp_path / "empty"
    empty.mkdir()
    assert "has no picture" in told([row], grey, at=empty)


def two_pictures(folder, image):
    folder.mkdir()
    for name in ("b.png", "c.png"):
        cv2.imwrite(str(folder / name), image)
    return folder


def write(path, rows):
    path.write_text(json.dumps(rows))
    return path
