"""Light fitted to pictures: our own under known boxes as the pictures of others."""

import json
from dataclasses import replace

import cv2
import msgspec
import numpy as np
import pytest
from typer.testing import CliRunner

from flyaround.cli import app
from simulator.camera.lens.files import load_camera
from simulator.compare.fitted_pairs import correlation, fit_pictures, structural_similarity
from simulator.compare.light_fit import candidate_lights, fit_light, fit_materials, light_basis, scene_at_pose
from simulator.compare.references import Reference, fitted
from simulator.imaging.image_formation import digitise_scene, expose_scene
from simulator.targets.library import load_target
from simulator.world.frames.pose import Pose
from simulator.world.frames.rotation import quat_from_rotvec

TARGET = "tango-mockup@low"
STRONG = {40: 900.0, 33: 400.0}
"""Radiance of the candidates that light the picture [W m-2 sr-1]."""


def test_a_picture_is_like_itself_and_correlation_does_not_mind_brightness() -> None:
    image = np.random.default_rng(5).integers(0, 200, (40, 50)).astype(np.uint8)
    assert structural_similarity(image, image).mean() == pytest.approx(1.0)
    assert structural_similarity(image, 200 - image).mean() < 0
    assert correlation(image, (image // 2 + 20).astype(np.uint8)) == pytest.approx(1.0, abs=1e-3)
    assert correlation(image, np.full_like(image, 7)) == 0.0


@pytest.fixture(scope="module")
def pictures(renderer, tmp_path_factory):
    """A folder of two pictures under known boxes, SPEED's list beside it, and the references."""
    folder, target = tmp_path_factory.mktemp("pictures"), load_target(TARGET)
    camera, rows, references = fitted(load_camera("speed"), 480, 300), [], []
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


@pytest.mark.gl
def test_the_light_of_a_picture_is_found(renderer, pictures):
    basis = light_basis(renderer, pictures[1][0], load_target(TARGET))
    light = fit_light(basis)
    rows = [[one.position_m for one in basis.lights].index(box.position_m) for box in light.lights]
    found = np.array([box.radiance_w_m2_sr for box in light.lights]) / 1000 @ basis.drawn[rows]
    true = np.array(list(STRONG.values())) / 1000 @ basis.drawn[list(STRONG)]
    # boxes side by side light a face alike, so the light is held and not each box
    shown = true < 200
    assert np.sqrt(np.mean((found - true)[shown] ** 2)) < 0.15 * np.sqrt(np.mean(true[shown] ** 2))
    # the box that gives most light is found, or one beside it
    strongest = basis.lights[40].position_m
    assert min(np.linalg.norm(np.subtract(box.position_m, strongest)) for box in light.lights) < 1.3
    # noise, and borders of faces, which the small drawings do not blur
    assert light.residual_dn < 15.0
    assert light.black_dn == pytest.approx(30.0, abs=3.0)


@pytest.mark.gl
def test_a_material_twice_as_bright_is_told_by_both_pictures(renderer, pictures):
    target = load_target(TARGET)
    bases = [light_basis(renderer, one, target) for one in pictures[1]]
    told = [b.material[b.inner & (b.seen > 70) & (b.seen < 240)] for b in bases]
    k = int(np.bincount(np.concatenate(told)).argsort()[-2])
    dimmed = [replace(b, drawn=np.where(b.material == k, 0.5 * b.drawn, b.drawn)) for b in bases]
    factors = fit_materials(dimmed, target) / fit_materials(bases, target)
    assert factors[k] == pytest.approx(2.0, rel=0.15)


@pytest.mark.gl
def test_ours_under_the_fitted_light_is_like_the_picture(renderer, pictures):
    pairs, factors = fit_pictures(renderer, pictures[1], load_target(TARGET))
    assert not factors
    for pair in pairs:
        assert pair.ncc > 0.95
        assert pair.ours.dark_dn == pytest.approx(pair.theirs.dark_dn, abs=3.0)
        assert pair.ours.noise_dn == pytest.approx(pair.theirs.noise_dn, rel=0.1)
        assert pair.outline_px < 1.5  # noise moves ridges


@pytest.mark.gl
def test_the_command_writes_a_page_and_says_mistakes(pictures, tmp_path):
    folder, out = pictures[0], tmp_path / "page"
    words = ["compare", "--reference", str(folder), "--camera", "speed", "--target", TARGET, "-o", str(out)]
    run = CliRunner().invoke(app, [*words, "--poses", str(folder / "poses.json"), "-n", "1", "--json"])
    assert run.exit_code == 0, run.output
    document = json.loads(run.stdout)
    assert document["summary"]["all_ncc"] > 0.9
    assert json.loads((out / "fit.json").read_text()) == document
    assert (out / "index.html").is_file()
    (tmp_path / "none.json").write_text("[]")
    for more, says in (
        (["--poses", str(tmp_path / "none.json")], "pose is not known"),
        (["--fit-materials"], "--poses"),
        (["--poses", str(folder / "poses.json"), "--sensor", "speed"], "--sensor"),
    ):
        wrong = CliRunner().invoke(app, [*words[:-1], str(tmp_path / "wrong"), *more])
        assert wrong.exit_code != 0
        assert says in str(wrong.exception)
