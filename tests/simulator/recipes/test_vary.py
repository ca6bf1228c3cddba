"""Randomised frames: seeded, in the truth, of a craft millimetres off its model, and checked as drawn."""

import msgspec
import numpy as np
import pytest

from flyaround.__main__ import run
from flyaround.simulator.dataset.check.geometry import check_keypoints
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.truth import read_truth
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.scenario.load import load_recipe, load_vary
from flyaround.simulator.scenario.plan import varied_plan
from flyaround.simulator.scenario.vary import VaryBoxes
from flyaround.simulator.scene.limits import scene_problem
from flyaround.simulator.scene.record import SceneRecord
from flyaround.simulator.targets.library import load_target

RANGES = """
[craft]
every = 2
reflectance = [0.5, 0.9]
roughness = [0.8, 1.2]
model_error_mm = [5.0, 9.0]
[lights]
lamp_share = 0.5
earthshine_share = 0.5
[image]
exposure = [0.5, 2.0]
noise = [2.0, 3.0]
psf_sigma_px = [0.4, 1.6]
[background]
environments = ["full", "airless"]
"""


@pytest.fixture
def vary(tmp_path):
    path = tmp_path / "ranges.toml"
    path.write_text(RANGES)
    return load_vary(path)


def test_a_frame_is_varied_by_its_number_and_seed_alone_and_says_by_what(vary):
    plan = varied_plan(plan_recipe("eval-earth", 40, seed=5), vary)
    few = varied_plan(plan_recipe("eval-earth", 12, seed=5), vary)
    assert plan.scene(11) == few.scene(11)
    base = plan_recipe("eval-earth", 40, seed=5)
    scenes = [plan.scene(k) for k in range(40)]
    for k, s in enumerate(scenes):
        by, was = s.sample.varied, base.scene(k)
        assert s.exposure_s == pytest.approx(was.exposure_s * by.exposure)
        assert 0.5 <= by.exposure <= 2
        assert s.sensor.gaussian_variance == pytest.approx(was.sensor.gaussian_variance * by.noise**2)
        assert s.sensor.blur_sigma_px == by.psf_sigma_px
        assert (s.lamp is not None) == by.lamp
        assert s.environment.earthshine == by.earthshine
        assert s.environment.atmosphere == (by.environment == "full")
        assert by.craft == k // 2
        # the pose is the recipe's
        assert s.t_camera_from_target_m == was.t_camera_from_target_m
        assert scene_problem(s) is None
    assert {s.lamp is None for s in scenes} == {True, False}
    assert len({s.target.sha256 for s in scenes}) == 20
    assert (
        msgspec.json.decode(msgspec.json.encode(SceneRecord.from_scene(scenes[3])), type=SceneRecord).scene()
        == scenes[3]
    )


def test_the_craft_is_its_model_moved_by_the_error_and_does_not_turn(vary):
    plan = varied_plan(plan_recipe("eval-black", 6, seed=1), vary)
    model = load_target("tango")
    for k in (0, 2, 4):
        reference = plan.scene(k).target
        craft = reference.drawn(model)
        assert craft.sha256 == reference.sha256 != model.sha256
        before, after = (
            np.concatenate([p.positions_m for p in t.parts]).astype(float) for t in (model, craft)
        )
        moved = np.linalg.norm(after - before, axis=1).max()
        assert moved == pytest.approx(reference.variation.error_m, rel=1e-3)
        assert 0.005 <= moved <= 0.009
        # the rotation that fits best is none: an error of the model is none of the pose
        u, _, vt = np.linalg.svd(np.eye(3) + np.array(reference.variation.stretch))
        assert np.allclose(u @ vt, np.eye(3), atol=1e-6)
        shade = [
            m.base_color[0] / o.base_color[0] for m, o in zip(craft.materials, model.materials, strict=True)
        ]
        assert 0.49 < min(shade) < max(shade) < 0.91


def test_a_pedestal_needs_a_detector_and_ranges_the_right_way_round(tmp_path):
    path = tmp_path / "ranges.toml"
    path.write_text("[image]\npedestal_dn = [5.0, 50.0]\n")
    with pytest.raises(UserError, match="use preset imx174 or cmv4000"):
        varied_plan(plan_recipe("eval-black", 1), load_vary(path))
    path.write_text("[image]\nexposure = [2.0, 0.5]\n")
    with pytest.raises(UserError, match=r"image\.exposure is \[2, 0\.5\], allowed: the smaller first"):
        load_vary(path)
    path.write_text("[image]\nexposre = [2.0, 0.5]\n")
    with pytest.raises(UserError, match="did you mean exposure"):
        load_vary(path)
    with pytest.raises(UserError, match="cannot be read"):
        load_vary(tmp_path / "absent.toml")


def test_a_file_of_ranges_is_merged_by_key_with_a_recipes_own(tmp_path):
    own = load_recipe("randomised").vary
    path = tmp_path / "ranges.toml"
    path.write_text('[image]\nnoise = [1.0, 1.5]\n[background]\nenvironments = ["airless"]\n[boxes]\n')
    merged = load_vary(path, own)
    assert (merged.craft, merged.lights) == (own.craft, own.lights)
    assert merged.image == msgspec.structs.replace(own.image, noise=(1.0, 1.5))
    assert merged.background.environments == ["airless"]
    assert merged.boxes == VaryBoxes()
    # without the recipe's own, what the file does not name is not varied
    assert load_vary(path).craft is None
    plan = varied_plan(plan_recipe("randomised", 2), load_vary(path))
    assert plan.scenario_document["vary"]["craft"] is None
    path.write_text("[image]\npsf_sigma_px = [3.0, 2.5]\n")
    with pytest.raises(UserError, match=r"image\.psf_sigma_px is \[3, 2\.5\], allowed: the smaller first"):
        load_vary(path, own)


def test_ranges_of_a_recipe_are_merged_by_key_with_its_bases(tmp_path):
    own = load_recipe("lightbox").vary
    path = tmp_path / "mine.toml"
    path.write_text('schema = "flyaround.recipe"\nbase = "lightbox"\n[vary.image]\nnoise = [1.0, 1.5]\n')
    merged = load_recipe(path).vary
    assert merged == msgspec.structs.replace(own, image=msgspec.structs.replace(own.image, noise=(1.0, 1.5)))
    path.write_text(path.read_text() + "exposure = [2.0, 1.0]\n")
    with pytest.raises(UserError, match=r"vary\.image\.exposure is \[2, 1\], allowed: the smaller first"):
        load_recipe(path)


@pytest.mark.gl
def test_a_varied_set_is_checked_as_it_was_drawn(tmp_path, vary):
    assert vary.craft is not None
    out = tmp_path / "set"
    ranges = str(tmp_path / "ranges.toml")
    small = tmp_path / "small.json"
    small.write_text(
        '{"width_px": 320, "height_px": 200, "fx_px": 500, "fy_px": 500, "cx_px": 159.5, "cy_px": 99.5, '
        '"distortion": {"model": "none", "coefficients": []}}'
    )
    # the lowest level of detail: its mesh is soonest baked
    command = ["capture", "eval-black", "-n", "2", "-o", str(out), "--target", "tango@low"]
    assert run([*command, "--vary", ranges, "--camera", str(small), "--labels", "parts,wireframe"]) == 0
    assert run(["check", str(out), "--redraw", "1"]) == 0
    truth = read_truth(out / "images" / "000001.json")
    assert truth.scene.sample.varied.craft == 0
    # the labels are of the craft, not of the model
    from flyaround.simulator.dataset.card import read_card

    card = read_card(out)
    assert check_keypoints(truth, card) == []
    assert {k.name: tuple(k.target_m) for k in truth.keypoints} != dict(card.target.keypoints)
