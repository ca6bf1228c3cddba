"""Labels drawn over copies of a data set's pictures: where they belong, in their colours, and nothing else touched."""

import dataclasses

import cv2
import numpy as np
import pytest

import flyaround as fa
from flyaround.__main__ import run
from flyaround.simulator.dataset.capture import capture
from flyaround.simulator.imaging.display import display_picture
from flyaround.simulator.labels.overlay import AXES
from flyaround.simulator.recipes.plan import plan_recipe

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    folder = tmp_path_factory.mktemp("overlays") / "set"
    plan = plan_recipe("eval-black", 3, target="tango@low", quality="draft")
    capture(dataclasses.replace(plan, camera=plan.camera.resized(480)), folder)
    return folder


def _pictures(folder):
    return {int(p.stem): cv2.imread(str(p))[..., ::-1] for p in sorted(folder.glob("*.png"))}


def test_axes_are_drawn_from_the_origin_along_x_y_z_in_red_green_blue(dataset, tmp_path):
    before = {p: p.read_bytes() for p in dataset.rglob("*") if p.is_file()}
    assert run(["overlay", str(dataset), "-o", str(tmp_path / "out")]) == 0
    drawn = _pictures(tmp_path / "out")
    assert sorted(drawn) == [0, 1, 2]
    for frame in fa.open_dataset(dataset):
        picture = drawn[frame.number]
        shown = display_picture(frame.image, frame.truth.scene.sensor, frame.camera.pixel_encoding)
        changed = np.any(picture != shown[..., None], axis=2)
        assert 20 < np.count_nonzero(changed) < 0.1 * changed.size
        for axis, colour in zip(np.eye(3), AXES, strict=True):
            # on the shaft, a third of the way along
            at = frame.camera.project(frame.pose.apply(0.15 * axis))
            u, v = np.rint(at).astype(int)
            about = picture[v - 2 : v + 3, u - 2 : u + 3].reshape(-1, 3).astype(int)
            assert np.abs(about - colour).sum(axis=1).min() < 60
    assert {p: p.read_bytes() for p in dataset.rglob("*") if p.is_file()} == before


def test_every_mark_shows_and_frames_are_spread(dataset, tmp_path):
    for mark in ("wireframe", "keypoints", "box", "mask"):
        out = tmp_path / mark
        assert run(["overlay", str(dataset), "-o", str(out), "--draw", mark, "-n", "2"]) == 0
        drawn = _pictures(out)
        assert sorted(drawn) == [0, 2]
        frame = fa.open_dataset(dataset)[0]
        shown = display_picture(frame.image, frame.truth.scene.sensor, frame.camera.pixel_encoding)
        assert 20 < np.any(drawn[0] != shown[..., None], axis=2).sum() < shown.size / 2


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--draw", "axis"], "there is no 'axis'; choose from axes, wireframe"),
        (["--draw", ","], "nothing is named"),
        (["-o", "{set}/pictures"], "is within the data set"),
        (["-o", "{set}"], "is within the data set"),
    ],
)
def test_what_cannot_be_drawn_is_told(dataset, tmp_path, capsys, options, words):
    given = [word.format(set=dataset) for word in options]
    place = [] if "-o" in given else ["-o", str(tmp_path / "out")]
    assert run(["overlay", str(dataset), *place, *given]) == 2
    assert words in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "out").exists()
    assert run(["overlay", str(tmp_path), "-o", str(tmp_path / "out")]) == 2
