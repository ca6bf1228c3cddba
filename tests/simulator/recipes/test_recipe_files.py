"""Recipe files: what is wrong with one is said in a sentence, what it takes from its base, and what it draws."""

import csv
import json

import cv2
import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flyaround.__main__ import run
from flyaround.simulator.errors import UserError
from flyaround.simulator.frame import take_frame
from flyaround.simulator.recipes.backgrounds import draw_view, without_target
from flyaround.simulator.recipes.clearance import is_clear
from flyaround.simulator.recipes.euler_poses import from_left_handed, quat_from_euler
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.recipes.poses import draw_pose
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.scenario.load import built_in_text, list_recipes, load_recipe
from flyaround.simulator.scenario.show import show_recipe
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.frames.pose import Pose
from flyaround.simulator.world.frames.rotation import matrix_from_quat

HEAD = 'schema = "flyaround.recipe"\nversion = 1\ntitle = "mine"\n'


def recipe_file(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(HEAD + text)
    return path


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[range]\nkind = "uniform"\nnear_m = 9.0\nfar_m = 3.0\n', r"near_m 9 beyond far_m 3"),
        ('[range]\nkind = "uniform"\nnear_m = -1.0\nfar_m = 3.0\n', r"range\.near_m is -1"),
        ('[range]\nkind = "unifrom"\nnear_m = 1.0\nfar_m = 3.0\n', r"did you mean 'uniform'"),
        ("[range]\nnear_m = 1.0\nfar_m = 3.0\n", r"lacks the key kind"),
        (
            '[range]\nkind = "normal"\nmean_m = 900.0\nsigma_m = 0.1\nnear_m = 3.0\nfar_m = 9.0\n',
            r"no draw from the normal",
        ),
        ('[range]\nkind = "uniform"\nnear_m = 0.1\nfar_m = 0.15\n', r"inside of tango"),
        ("[[sky]]\nnadir_off_boresight_deg = [60.0, 10.0]\n", r"the smaller first"),
        (
            "[[sky]]\nnadir_off_boresight_deg = [0.0, 5.0]\nmax_phase_deg = 5.0\nnight_share = 1.0\n",
            r"leave no dark ground",
        ),
        (
            '[[sky]]\nbody = "earth"\naltitude_km = 25.0\nnadir_off_boresight_deg = [0.0, 5.0]\n',
            r"at least 100",
        ),
        (
            "[constraints]\nclearance_m = 400.0\nmost_draws = 200\n",
            r"200 poses in a row .* clearance_m = 400, with tango at 3 to 18 m",
        ),
        ('[poses]\nkind = "list"\nfile = "absent.csv"\n', r"cannot read poses"),
        ('[poses]\nkind = "trajectory"\nscenario = "tango-vbra"\n', r"there is no scenario 'tango-vbra'"),
        ('[poses]\nkind = "trajectory"\nscenario = "tango-limb"\n[background]\n', r"its own sky"),
        ('base = "eval-read"\n', r"eval-earth"),
        ('base = "mine.toml"\n', r"form a cycle"),
        ('base = "../mine.toml"\n', r"not within"),
        ("frames = 0\n", r"frames is 0, allowed: a whole number of at least 1"),
        ("rnage = 1\n", r"unknown key rnage .* did you mean range"),
    ],
)
def test_a_mistake_is_said_in_a_sentence(tmp_path, text, words):
    with pytest.raises(UserError, match=words):
        plan_recipe(recipe_file(tmp_path, text), 1)


def test_a_file_takes_from_its_base_what_it_does_not_say(tmp_path):
    mine = load_recipe(recipe_file(tmp_path, 'base = "eval-earth"\n[attitude]\nkind = "euler"\n'))
    earth = load_recipe("eval-earth")
    assert (mine.name, mine.title, mine.sky, mine.sensor) == ("mine", "mine", earth.sky, earth.sensor)
    assert mine.attitude.to_deg == 360.0


@pytest.mark.parametrize("name", list_recipes())
def test_what_is_shown_loads_again_as_the_same_recipe(name, tmp_path):
    path = tmp_path / f"{name}.toml"
    path.write_text(show_recipe(name))
    assert load_recipe(path) == load_recipe(name)
    assert built_in_text("recipe", name).splitlines()[0] in path.read_text()


def test_the_papers_quaternion_is_scipys_of_turns_about_fixed_axes():
    rng = np.random.default_rng(1)
    for angles in rng.uniform(-360, 360, (200, 3)):
        x, y, z, w = Rotation.from_euler("xyz", angles, degrees=True).as_quat()
        q = quat_from_euler(angles)
        # both of one rotation may stand
        assert min(np.abs(q - [w, x, y, z]).max(), np.abs(q - [-w, -x, -y, -z]).max()) < 1e-12


def test_the_mirror_of_both_axes_turns_a_point_as_the_left_handed_axes_have_it():
    rng = np.random.default_rng(2)
    mirror = np.diag([1.0, -1.0, 1.0])
    for angles in rng.uniform(-360, 360, (20, 3)):
        q = quat_from_euler(angles)
        assert np.allclose(
            matrix_from_quat(from_left_handed(q)), mirror @ matrix_from_quat(q) @ mirror, atol=1e-12
        )


@pytest.mark.parametrize(
    ("name", "target", "x", "y", "near"),
    [
        ("paper-dragon", "dragon", 2.0, 1.0, 5.0),
        ("paper-soyuz", "soyuz-ms", 1.0, 0.8, 5.0),
        ("paper-tianzhou", "tianzhou", 2.0, 1.0, 7.0),
        ("paper-change6", "change6-ascender", 2.0, 1.0, 5.0),
    ],
)
def test_the_papers_bounds_are_those_of_its_table(name, target, x, y, near):
    """Table 2, equation 1 and algorithm 1."""
    plan = plan_recipe(name)
    assert (plan.n_frames, plan.target.name, plan.bands) == (10_000, target, "rgb")
    assert (plan.camera.width_px, plan.camera.height_px) == (1280, 960)
    # 8.9 mm before 8.8 x 6.6 mm
    assert plan.camera.fx_px == pytest.approx(8.9 / 8.8 * 1280, abs=1e-6)
    assert plan.recipe.split == [8000, 1000, 1000]
    scenes = [plan.scene(k) for k in range(60)]
    t = np.array([s.t_camera_from_target_m for s in scenes])
    assert near <= t[:, 2].min() < near + 3
    assert 37 < t[:, 2].max() <= 40
    share = np.abs(t[:, :2]) / t[:, 2:] * near / [x, y]
    assert 0.93 < share.max() <= 1 + 1e-12
    angles = np.array([s.sample.raw.euler_deg for s in scenes])
    assert angles.min() < -330
    assert angles.max() > 330
    for s in scenes[:20]:
        raw = s.sample.raw
        assert np.allclose(np.array(raw.position_m) * [1, -1, 1], s.t_camera_from_target_m)
        q = from_left_handed(quat_from_euler(raw.euler_deg))
        assert abs(abs(q @ s.q_camera_from_target_wxyz) - 1) < 1e-12
        assert s.sun_visible_fraction > 0.99
        assert s.central_body == ("moon" if target == "change6-ascender" else "earth")


def test_the_papers_attitudes_are_not_uniform_and_the_other_recipes_are():
    """Of Euler angles the middle one's sine is not uniform, of Haar measure the view along an axis is."""

    def axis_x(name):
        plan = plan_recipe(name, 1)
        rng = np.random.default_rng(5)
        drawn = [draw_pose(rng, plan.recipe, plan.camera, plan.target, k) for k in range(2000)]
        views = [matrix_from_quat(d.q_camera_from_target_wxyz)[2, 0] for d in drawn]
        return np.abs(np.sort(views) - (2 * (np.arange(2000) + 0.5) / 2000 - 1)).max() / 2

    assert axis_x("paper-soyuz-uniform") < 1.95 / np.sqrt(2000) < axis_x("paper-soyuz")


def test_a_view_of_a_library_depends_on_its_number_alone_and_shows_the_body():
    plan = plan_recipe("paper-dragon", 1)
    library = plan.library()
    few = plan.library(20)
    seen = 0
    for i in range(20):
        view = draw_view(library, plan.camera, i)
        again = draw_view(few, plan.camera, i)
        assert np.array_equal(view.place.camera_eci_m, again.place.camera_eci_m)
        assert np.array_equal(view.euler_deg, again.euler_deg)
        r = view.place.camera_eci_m / np.linalg.norm(view.place.camera_eci_m)
        nadir = view.place.R_eci_from_camera.T @ -r
        seen += nadir[2] > np.cos(np.radians(70))
    assert 5 < seen < 20  # whole of the image or part of it
    with pytest.raises(UserError, match="3001 views are requested"):
        plan.library(3001)


def test_the_background_in_the_label_is_the_place_that_was_drawn():
    plan = plan_recipe("paper-change6", 8, seed=2)
    ids = set()
    for k in range(8):
        s = plan.scene(k)
        view = draw_view(plan.library(), plan.camera, s.sample.background.id)
        assert tuple(view.place.camera_eci_m) == s.r_camera_eci_m
        ids.add(s.sample.background.id)
    assert len(ids) > 6


def test_clearance_is_that_of_the_nearest_face():
    target = load_target("tango")
    points = np.concatenate([p.positions_m for p in target.parts]).astype(float)
    triangles = np.concatenate([p.positions_m[p.triangles] for p in target.parts]).astype(float)
    import trimesh

    rng = np.random.default_rng(3)
    for _ in range(12):
        place = rng.uniform(points.min(axis=0) - 0.5, points.max(axis=0) + 0.5)
        pose = Pose.from_arrays("camera", "target", [1, 0, 0, 0], -place)
        near = trimesh.triangles.closest_point(triangles, np.repeat(place[None], len(triangles), axis=0))
        distance = np.linalg.norm(near - place, axis=1).min()
        assert not is_clear(pose, target, distance * 1.0001)
        outside = np.any((place < points.min(axis=0)) | (place > points.max(axis=0)))
        if outside:
            assert is_clear(pose, target, distance * 0.9999)
    # in the middle of the body there is room to every side, and yet it is inside
    assert not is_clear(Pose.from_arrays("camera", "target", [1, 0, 0, 0], [0, 0, -0.02]), target, 1e-3)


def test_poses_that_break_a_constraint_are_drawn_again_and_counted(tmp_path):
    text = '[range]\nkind = "uniform"\nnear_m = 0.3\nfar_m = 2.0\n[constraints]\nclearance_m = 0.5\n'
    plan = plan_recipe(recipe_file(tmp_path, text), 12, seed=3)
    scenes = [plan.scene(k) for k in range(12)]
    assert sum(s.sample.redraws["clearance_m"] for s in scenes) > 1
    for scene in scenes:
        assert is_clear(scene.camera_from_target, plan.target, 0.5)


def test_a_list_of_poses_is_drawn_as_it_stands(tmp_path):
    plan = plan_recipe("paper-soyuz", 5, seed=6)
    table = tmp_path / "poses.csv"
    assert run(["recipes", "paper-soyuz", "--samples", str(table), "-n", "5", "--seed", "6"]) == 0
    rows = list(csv.DictReader(table.read_text().splitlines()))
    assert [float(r["t_z_m"]) for r in rows] == [plan.scene(k).t_camera_from_target_m[2] for k in range(5)]
    assert float(rows[2]["ry"]) == plan.scene(2).sample.raw.euler_deg[1]
    listed = plan_recipe(
        recipe_file(tmp_path, 'target = "soyuz-ms"\n[poses]\nkind = "list"\nfile = "poses.csv"\n')
    )
    assert listed.n_frames == 5
    for k in range(5):
        assert np.allclose(
            listed.scene(k).q_camera_from_target_wxyz, plan.scene(k).q_camera_from_target_wxyz, atol=1e-15
        )
    with pytest.raises(UserError, match="poses for 5"):
        plan_recipe(tmp_path / "mine.toml", 6)


def test_pairs_differ_in_their_environment_alone(tmp_path):
    plan = plan_recipe(recipe_file(tmp_path, '[pairs]\nenvironments = ["full", "airless"]\n'), 6)
    a, b = plan.scene(2), plan.scene(3)
    assert (a.environment.atmosphere, b.environment.atmosphere) == (True, False)
    assert (a.sample.pair.pair, b.sample.pair.pair, b.sample.pair.environment) == (1, 1, "airless")
    same = {f: getattr(a, f) == getattr(b, f) for f in a.__dataclass_fields__}
    assert [f for f, equal in same.items() if not equal] == ["frame_index", "environment", "sample"]


def test_sequences_fly_on_within_and_start_anew_between(tmp_path):
    text = (
        '[poses]\nkind = "sequences"\nscenario = "tango-vbar-hold"\nframes = 3\nevery_s = 2.0\n'
        "range_m = [5.0, 9.0]\nrate_deg_s = [1.0, 4.0]\n"
    ).replace("tango-vbar-hold", "tango-earth-10m")
    plan = plan_recipe(recipe_file(tmp_path, text), 6, seed=1)
    scenes = [plan.scene(k) for k in range(6)]
    assert [s.sample.sequence.sequence for s in scenes] == [0, 0, 0, 1, 1, 1]
    assert [s.t_s for s in scenes] == [0, 2, 4, 0, 2, 4]
    for s in scenes:
        # at least the drawn rate, in inertial axes
        assert 0.9 < np.degrees(np.linalg.norm(s.omega_target_rad_s)) < 4.2
    turns = [
        2 * np.degrees(np.arccos(abs(np.dot(a.q_camera_from_target_wxyz, b.q_camera_from_target_wxyz))))
        for a, b in ((scenes[0], scenes[1]), (scenes[2], scenes[3]))
    ]
    assert turns[0] < 9
    assert plan.next_scene(1) == scenes[2]
    assert plan.next_scene(2) is None


def test_the_card_names_the_recipe_and_its_document_is_one(tmp_path):
    plan = plan_recipe("eval-earth", 1, target="soyuz-ms")
    document = json.loads(json.dumps(plan.scenario_document))
    assert document["target"] == "soyuz-ms"
    assert msgspec.convert(document, type(plan.recipe)) == plan.recipe


def test_recipes_and_scenarios_are_listed_apart(capsys):
    assert run(["recipes", "--json"]) == 0
    recipes = {r["name"] for r in json.loads(capsys.readouterr().out)}
    assert run(["scenarios", "--json"]) == 0
    scenarios = {s["name"] for s in json.loads(capsys.readouterr().out)}
    assert recipes == set(list_recipes())
    assert not recipes & scenarios
    assert run(["fly", "eval-black", "-o", "nowhere"]) == 2
    assert "recipe of independent samples" in capsys.readouterr().err
    assert run(["scenarios", "--show", "eval-black"]) == 2
    assert "flyaround recipes --show" in capsys.readouterr().err


@pytest.mark.gl
def test_the_picture_of_a_view_is_what_stands_behind_the_craft(tmp_path):
    small = tmp_path / "small.json"
    small.write_text(
        '{"width_px": 320, "height_px": 240, "fx_px": 323.6, "fy_px": 323.6, "cx_px": 159.5, "cy_px": 119.5, '
        '"distortion": {"model": "none", "coefficients": []}}'
    )
    plan = plan_recipe("paper-change6", 3, camera=small, seed=4, target="tango@low", bands="mono")
    scene = plan.scene(1)
    view = without_target(plan.scene_before(plan.library(), scene.sample.background.id))
    with Renderer() as renderer:
        behind = take_frame(renderer, view, plan.target, labels=False)
        with_craft = take_frame(renderer, scene, plan.target)
    craft = cv2.dilate(with_craft.mask, np.ones((9, 9), np.uint8)) > 0
    assert 20 < craft.sum() < 0.2 * craft.size
    assert behind.image.max() > 20  # the Moon's day side
    assert np.array_equal(behind.image[~craft], with_craft.image[~craft])
