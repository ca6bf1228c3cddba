"""Stereo pairs: two cameras of one instant, whose labels meet in space; and what `check` says where they do not."""

import json
import shutil
from dataclasses import replace

import cv2
import msgspec
import numpy as np
import pytest

from flyaround.__main__ import run
from flyaround.simulator.dataset.capture import capture
from flyaround.simulator.dataset.check.verify import check_dataset
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.truth import read_truth
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.scenario.load import load_recipe, load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.scene.illumination.lamp import Lamp
from flyaround.simulator.scene.second_camera import SecondCamera, second_camera_scene
from flyaround.simulator.world.frames.rotation import matrix_from_quat

RECIPE = """
schema = "flyaround.recipe"
version = 1
base = "eval-black"
[range]
kind = "uniform"
near_m = 4.0
far_m = 6.0
[[sky]]
nadir_off_boresight_deg = [90.0, 180.0]
max_phase_deg = 50.0
[camera]
width_px = 480
height_px = 300
fx_px = 750.0
fy_px = 750.0
cx_px = 239.5
cy_px = 149.5
[second_camera]
position_m = [0.4, 0.05, -0.1]
turn_deg = [0.5, -3.0, 1.0]
"""


@pytest.fixture(scope="module")
def pairs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stereo")
    (folder / "pair.toml").write_text(RECIPE)
    summary = capture(plan_recipe(folder / "pair.toml", 2, seed=5), folder / "set", split=(1, 1, 0))
    assert summary.second is not None
    assert (summary.n_written, summary.second.n_written) == (2, 2)
    # the two of a pair are of one split
    assert (folder / "set/split.json").read_bytes() == (folder / "set/second/split.json").read_bytes()
    return folder / "set"


@pytest.mark.gl
def test_the_two_cameras_labels_meet_in_space(pairs):
    """OpenCV's triangulation of both cameras' pixels gives the keypoints where the first one's pose has them."""
    report = check_dataset(pairs, redraw=1.0, redraw_seed=1)
    assert report.faults == ()
    assert report.n_frames == 4
    cards = [json.loads((place / "dataset.json").read_text()) for place in (pairs, pairs / "second")]
    assert [card["stereo"]["camera"] for card in cards] == ["first", "second"]
    stereo = cards[0]["stereo"]
    R = matrix_from_quat(stereo["q_second_from_first_wxyz"])
    # a rotation vector of the first's axes into the second's: OpenCV's own form, the other way round
    np.testing.assert_allclose(R.T, cv2.Rodrigues(np.radians([0.5, -3.0, 1.0]))[0], atol=1e-12)
    t = -R @ stereo["position_m"]
    for k in range(2):
        a, b = (read_truth(place / "images" / f"{k:06d}.json") for place in (pairs, pairs / "second"))
        c = a.camera
        K = np.array([[c.fx_px, 0, c.cx_px], [0, c.fy_px, c.cy_px], [0, 0, 1.0]])
        one, two = K @ np.eye(3, 4), K @ np.column_stack([R, t])
        for p, q in zip(a.keypoints, b.keypoints, strict=True):
            assert p.name == q.name
            where = cv2.triangulatePoints(
                one, two, np.array(p.pixel_px).reshape(2, 1), np.array(q.pixel_px).reshape(2, 1)
            ).ravel()
            expected = matrix_from_quat(a.q_camera_from_target_wxyz) @ p.target_m + a.t_camera_from_target_m
            np.testing.assert_allclose(where[:3] / where[3], expected, atol=1e-5)
        images = [
            cv2.imread(str(place / "images" / f"{k:06d}.png"), -1) for place in (pairs, pairs / "second")
        ]
        # where neither sees the craft there is noise alone, and not the same
        empty = [image[:40, :40].astype(float) for image in images]
        assert abs(np.corrcoef(empty[0].ravel(), empty[1].ravel())[0, 1]) < 0.2


@pytest.mark.gl
def test_check_finds_a_pair_that_does_not_belong_together(pairs, tmp_path):
    wrong = tmp_path / "wrong"
    shutil.copytree(pairs, wrong)
    card = json.loads((wrong / "dataset.json").read_text())
    card["stereo"]["position_m"][0] += 0.01
    (wrong / "dataset.json").write_text(json.dumps(card))
    faults = check_dataset(wrong, redraw=0.0).faults
    assert {fault.frame for fault in faults} == {0, 1}
    assert all("pair's geometry" in fault.what for fault in faults)
    shutil.copytree(pairs, tmp_path / "half")
    (tmp_path / "half" / "second" / "images" / "000001.json").unlink()
    found = {(f.frame, f.what) for f in check_dataset(tmp_path / "half", redraw=0.0).faults}
    assert (1, "only one of the two cameras has it") in found
    shutil.rmtree(tmp_path / "half" / "second")
    assert any("missing" in f.what for f in check_dataset(tmp_path / "half", redraw=0.0).faults)


def test_a_flight_has_pairs_whose_rates_are_of_one_body():
    """Positions a moment apart differ by the velocity that the second camera's own record says."""
    scenario = msgspec.structs.replace(
        load_scenario("tango-flyaround"),
        second_camera=SecondCamera(position_m=(0.5, -0.2, 0.1), turn_deg=(1.0, -4.0, 2.0)),
    )
    plan = plan_flight(scenario, times=(10.0, 10.01))
    first, second = (second_camera_scene(plan.scene(k), plan.second_camera) for k in (0, 1))
    step = np.subtract(second.t_camera_from_target_m, first.t_camera_from_target_m)
    np.testing.assert_allclose(step / 0.01, first.v_target_camera_m_s, atol=2e-5)
    away = np.subtract(second.r_camera_eci_m, first.r_camera_eci_m)
    np.testing.assert_allclose(away / 0.01, first.v_camera_eci_m_s, atol=0.1)
    # the target is where it is, whoever looks
    places = []
    for scene in (plan.scene(0), first):
        R = matrix_from_quat(scene.q_camera_from_eci_wxyz).T
        places.append(np.asarray(scene.r_camera_eci_m) + R @ scene.t_camera_from_target_m)
    np.testing.assert_allclose(places[0], places[1], atol=1e-6)


def test_the_second_camera_moves_as_the_end_of_an_arm_of_the_first():
    """Central differences of the way between the two, which a turning pair carries round."""
    pair = SecondCamera(position_m=(0.5, -0.2, 0.1), turn_deg=(1.0, -4.0, 2.0))
    plan = plan_flight(load_scenario("tango-flyaround"), times=(9.9, 10.0, 10.1))
    scenes = [(plan.scene(k), second_camera_scene(plan.scene(k), pair)) for k in range(3)]
    arms = [np.subtract(second.r_camera_eci_m, first.r_camera_eci_m) for first, second in scenes]
    speed = (arms[2] - arms[0]) / 0.2
    first, second = scenes[1]
    assert np.linalg.norm(speed) > 2e-3
    np.testing.assert_allclose(np.subtract(second.v_camera_eci_m_s, first.v_camera_eci_m_s), speed, atol=1e-4)


def test_a_lamp_of_the_first_camera_cannot_be_told_to_a_turned_one():
    recipe = msgspec.structs.replace(load_recipe("eval-black"), lamp=Lamp(power_w=50.0))
    scene = plan_recipe(recipe, 1).scene(0)
    beside = second_camera_scene(scene, SecondCamera(position_m=(0.4, 0.0, 0.0)))
    assert beside.lamp.offset_m == (-0.4, 0.0, 0.0)
    with pytest.raises(UserError, match="boresight"):
        second_camera_scene(scene, SecondCamera(position_m=(0.4, 0.0, 0.0), turn_deg=(0.0, 1.0, 0.0)))
    assert replace(beside, lamp=None).seed != scene.seed


def test_a_mistake_in_the_section_is_one_sentence(tmp_path, capsys):
    path = tmp_path / "bad.toml"
    for section in (
        "position_m = [0.4, 0.0]",
        "turn_deg = [0, 0, 0]",
        "position_m = [0.4, 0, 0]\nturn_deg = [0, 900, 0]",
    ):
        path.write_text(RECIPE[: RECIPE.index("[second_camera]")] + f"[second_camera]\n{section}\n")
        assert run(["capture", str(path), "-n", "1", "-o", str(tmp_path / "out")]) == 2
        assert "second_camera" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
