"""A plan from the public API is what `capture` draws: the same scenes, craft and bytes for every recipe."""

import json

import pytest

import flyaround as fa
from flyaround.__main__ import run
from flyaround.simulator.dataset.formats.native import decode_png, encode_png

SINGLE = [name for name in fa.list_recipes() if not fa.load_recipe(name).members]
SEED = 5


@pytest.fixture
def small_camera(tmp_path):
    """A camera file of few pixels."""
    path = tmp_path / "small.json"
    camera = {"width_px": 160, "height_px": 100, "fx_px": 250, "fy_px": 250, "cx_px": 79.5, "cy_px": 49.5}
    path.write_text(json.dumps(camera | {"distortion": {"model": "none", "coefficients": []}}))
    return str(path)


@pytest.mark.parametrize("name", SINGLE)
def test_a_plan_has_the_scenes_and_the_craft_of_a_capture(name, tmp_path, monkeypatch):
    planned = []
    monkeypatch.setattr(
        "flyaround.cli.datasets.capture_plan", lambda plan, *_, **__: planned.append(plan) or 1 / 0
    )
    with pytest.raises(ZeroDivisionError):  # stopped before anything is drawn
        run(["capture", name, "-n", "2", "--seed", str(SEED), "-o", str(tmp_path / "set")])
    (captured,) = planned
    plan = fa.plan_recipe(name, n=2, seed=SEED)
    assert plan.scenario_document == captured.scenario_document
    for k in range(2):
        assert plan.scene(k) == captured.scene(k)
        assert plan.target_of(k).sha256 == captured.scene(k).target.sha256
    varied = plan.recipe.vary is not None
    assert varied == (getattr(plan.scene(1).sample, "varied", None) is not None)


def assert_same_pictures(renderer, name, camera, folder):
    """Draw two samples by the API and by the command line."""
    plan = fa.plan_recipe(name, n=2, seed=SEED, camera=camera)
    command = ["capture", name, "-n", "2", "--seed", str(SEED), "-o", str(folder)]
    assert run([*command, *(["--camera", camera] if camera else []), "--labels", ""]) in (0, 1)
    for k, frame in enumerate(fa.run_frames(plan, renderer)):
        path = next(folder.glob(f"**/{k:06d}.png"))
        drawn = [
            frame.image,
            fa.take_frame(renderer, plan.scene(k), plan.target).image,
            fa.take_frame(renderer, plan.scene(k), plan.target_of(k)).image,
        ]
        for image in drawn:
            assert encode_png(image) == path.read_bytes()
        assert decode_png(path.read_bytes(), "").max() > 60  # lit


@pytest.mark.gl
@pytest.mark.parametrize("name", ["lightbox", "randomised"])
def test_pictures_of_varied_recipes(renderer, name, small_camera, tmp_path):
    assert_same_pictures(renderer, name, small_camera, tmp_path / "set")


@pytest.mark.gl
@pytest.mark.slow
@pytest.mark.parametrize("name", SINGLE)
def test_pictures_of_every_recipe(renderer, name, tmp_path):
    assert_same_pictures(renderer, name, None, tmp_path / "set")
