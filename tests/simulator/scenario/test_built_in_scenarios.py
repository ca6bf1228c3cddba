"""Scenario files: every built-in one flies, and says what its title says."""

import json
import tomllib
from importlib.resources import files

import jsonschema
import msgspec
import numpy as np
import pytest
from scenario_text import GOOD, write

from flyaround.schemas import all_schemas
from flyaround.simulator.camera.detector.presets import list_sensor_presets, sensor_preset
from flyaround.simulator.camera.lens.files import list_cameras, load_camera
from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.document import SensorSection
from flyaround.simulator.scenario.flight import MAX_FRAMES, fly, frame_times
from flyaround.simulator.scenario.load import list_scenarios, load_scenario
from flyaround.simulator.scenario.scenario import Scenario
from flyaround.simulator.scene.environments import ENVIRONMENTS, Environment, environment_section
from flyaround.simulator.targets.model import MassProperties, Target
from flyaround.simulator.world.constants import EARTH_RADIUS_M
from flyaround.simulator.world.frames.rotation import matrix_from_quat

BOX = Target(
    name="tango",
    title="a box with Tango's mass",
    sha256="0" * 64,
    materials=(),
    parts=(),
    keypoints=(),
    wireframe=(),
    mass=MassProperties(
        mass_kg=40.0, com_m=(0.0, 0.02, 0.15), inertia_kg_m2=((1.5, 0, 0), (0, 1.6, 0), (0, 0, 2.2))
    ),
)


PICTURED = {
    "tango-flyaround",
    "tango-earth-10m",
    "tango-earth-10m-1024",
    "tango-space-10m",
    "tango-close-3m",
    "tango-limb",
    "geo-inspection",
    "iss-orbit-limb",
}
"""Chosen for their light: the Sun always behind the camera."""


def test_the_scenarios_are_there():
    flown = {
        "tango-vbar-approach",
        "tango-glideslope-to-docking",
        "tango-tumble-3-18m",
        "tango-eclipse-pass",
        "lunar-orbit",
    }
    assert PICTURED | flown | {"tango-night"} <= set(list_scenarios())


@pytest.mark.parametrize("name", list_scenarios())
def test_every_built_in_scenario_flies(name):
    scenario = load_scenario(name)
    assert scenario.name == name
    assert scenario.title
    assert scenario.description
    # a quarter of an hour of the long ones: their own tests fly them to the end
    span = min(scenario.duration_s, 900.0)
    flight = fly(scenario, BOX, span)
    for t in np.linspace(0, span, 7):
        state = flight.state(float(t))
        assert state.range_m > 1.9
        if name == "tango-night":
            assert state.sun_visible_fraction == 0.0
        elif name in PICTURED:
            assert phase_deg(state) < 90
            assert state.sun_visible_fraction == 1.0


def test_eclipse_pass_goes_in_and_out():
    scenario = load_scenario("tango-eclipse-pass")
    flight = fly(scenario, BOX)
    light = [flight.state(float(t)).sun_visible_fraction for t in np.linspace(0, scenario.duration_s, 50)]
    assert light[0] == light[-1] == 1.0
    assert min(light) == 0.0


def test_approaches_are_not_aborted():
    for name, end_m in (("tango-vbar-approach", 5.0), ("tango-glideslope-to-docking", 2.0)):
        flight = fly(load_scenario(name), BOX)
        assert flight.controlled is not None
        assert flight.controlled.abort_s is None
        assert flight.state(flight.duration_s).range_m == pytest.approx(end_m, abs=0.05)


def phase_deg(state):
    """Angle at the target between the Sun and the camera."""
    sun = np.array(state.r_sun_eci_m) - state.r_target_eci_m
    cosine = np.array(state.relative_eci_m) @ sun / (state.range_m * np.linalg.norm(sun))
    return float(np.degrees(np.arccos(cosine)))


def ground_elevations_deg(name, t_s):
    """Sun elevation where lines of sight through a grid of pixels meet the Earth, NaN for space."""
    scenario = load_scenario(name)
    camera, state = scenario.camera_model, fly(scenario, BOX).state(t_s)
    u, v = np.meshgrid(np.linspace(0, camera.width_px - 1, 15), np.linspace(0, camera.height_px - 1, 15))
    rays = np.stack(
        [(u - camera.cx_px) / camera.fx_px, (v - camera.cy_px) / camera.fy_px, np.ones_like(u)], axis=-1
    )
    d = rays / np.linalg.norm(rays, axis=-1, keepdims=True) @ matrix_from_quat(state.q_camera_from_eci_wxyz)
    r = np.array(state.r_chaser_eci_m)
    along = d @ r
    root = along**2 - (r @ r - EARTH_RADIUS_M**2)
    hit = (root > 0) & (along < 0)
    ground = r + d * np.where(hit, -along - np.sqrt(np.maximum(root, 0)), np.nan)[..., None]
    sun = np.array(state.r_sun_eci_m)
    return np.degrees(np.arcsin(ground @ sun / (EARTH_RADIUS_M * np.linalg.norm(sun))))


@pytest.mark.parametrize("name", ["tango-earth-10m", "tango-earth-10m-1024", "tango-close-3m"])
@pytest.mark.parametrize("t_s", [0.0, 60.0])
def test_lit_earth_fills_the_frame(name, t_s):
    elevation = ground_elevations_deg(name, t_s)
    assert np.all(elevation > 30)


def test_space_fills_the_frame():
    assert np.all(np.isnan(ground_elevations_deg("tango-space-10m", 30.0)))


def test_night_fills_the_frame():
    # astronomical night
    assert np.all(ground_elevations_deg("tango-night", 30.0) < -18)


def test_limb_crosses_the_frame_at_the_terminator():
    elevation = ground_elevations_deg("tango-limb", 30.0)
    assert 0.3 < np.mean(np.isnan(elevation)) < 0.7
    assert np.nanmin(elevation) < 0 < np.nanmax(elevation)


def test_flyaround_passes_earth_limb_and_space():
    share = {t: float(np.mean(np.isnan(ground_elevations_deg("tango-flyaround", t)))) for t in (0, 30, 60)}
    assert share[0] == 0
    assert 0.2 < share[30] < 0.8
    assert share[60] == 1
    # the limb fades from day into night
    elevation = ground_elevations_deg("tango-flyaround", 30.0)
    assert np.nanmin(elevation) < -2
    assert np.nanmax(elevation) > 5


def test_a_file_stands_for_itself(tmp_path):
    scenario = load_scenario(write(tmp_path, GOOD))
    assert scenario.name == "mine"
    assert scenario.camera_model == load_camera("speed")
    assert scenario.sensor_model == sensor_preset("speed")
    assert scenario.environment.layers() == Environment()
    # what a data set records reads back as the same scenario
    assert msgspec.convert(msgspec.to_builtins(scenario), Scenario) == scenario


def test_sections_follow_what_they_describe():
    presets = msgspec.inspect.type_info(SensorSection).fields
    assert next(f.type.values for f in presets if f.name == "preset") == tuple(sorted(list_sensor_presets()))


def test_sensor_overrides_and_camera_tables(tmp_path):
    text = GOOD.replace('preset = "speed"', 'preset = "thesis"\nblur_sigma_px = 0.5').replace(
        'camera = "speed"',
        "camera = { width_px = 640, height_px = 480, fx_px = 900, fy_px = 900, cx_px = 320, cy_px = 240 }",
    )
    scenario = load_scenario(write(tmp_path, text))
    assert scenario.sensor_model.blur_sigma_px == 0.5
    assert scenario.sensor_model.speckle_variance == 0.004
    assert scenario.camera_model.width_px == 640


def test_camera_file_is_found_beside_the_scenario(tmp_path):
    content = json.loads(files("flyaround.assets").joinpath("cameras", "paper.json").read_text())
    (tmp_path / "lens.json").write_text(json.dumps({**content, "name": ""}), encoding="utf-8")
    scenario = load_scenario(write(tmp_path, GOOD.replace('"speed"', '"lens.json"', 1)))
    assert scenario.camera_model == load_camera("paper")
    assert scenario.camera.name == "lens"


def test_attitude_by_quaternion_and_by_angles_agree(tmp_path):
    # yaw 90 deg: the target's x axis lies along the frame's y axis
    half = 2**-0.5
    states = []
    for line in (f"q_wxyz = [{half}, 0, 0, {half}]", "euler_deg = [90, 0, 0]"):
        text = GOOD.replace("[attitude]", f'[attitude]\nframe = "eci"\n{line}')
        states.append(fly(load_scenario(write(tmp_path, text)), BOX).state(0.0))
    assert np.allclose(states[0].q_eci_from_target_wxyz, states[1].q_eci_from_target_wxyz)
    assert np.allclose(matrix_from_quat(states[0].q_eci_from_target_wxyz) @ [1, 0, 0], [0, 1, 0])


def test_state_orbit_flies(tmp_path):
    text = GOOD.replace(
        'kind = "elements"\naltitude_km = 700.0',
        'kind = "state"\nr_eci_km = [7000, 0, 0]\nv_eci_km_s = [0, 1.0, 7.5]',
    )
    state = fly(load_scenario(write(tmp_path, text)), BOX).state(0.0)
    assert state.r_target_eci_m == (7e6, 0, 0)


@pytest.mark.parametrize("mode", ["drift", "circumnavigation", "vbar", "rbar", "flyaround"])
def test_every_mode_is_reached_from_a_file(mode, tmp_path):
    keys = {
        "drift": "position_lvlh_m = [0, -10, 0]",
        "circumnavigation": "radial_m = 10",
        "vbar": "start_m = -30\nhold_m = -5\nspeed_m_s = 0.5",
        "rbar": "start_m = -30\nhold_m = -5\nspeed_m_s = 0.5",
        "flyaround": "radius_m = 10\nperiod_s = 240",
    }[mode]
    text = GOOD.replace('mode = "hold"\nposition_lvlh_m = [0, -10, 0]', f'mode = "{mode}"\n{keys}')
    flight = fly(load_scenario(write(tmp_path, text)), BOX)
    first, last = flight.state(0.0), flight.state(60.0)
    if mode == "vbar":
        assert first.position_lvlh_m == pytest.approx((0, -30, 0), abs=1e-9)
        assert last.position_lvlh_m[0] == pytest.approx(0, abs=1e-9)
        assert last.position_lvlh_m[1] > first.position_lvlh_m[1]
    elif mode == "rbar":
        assert first.position_lvlh_m == pytest.approx((-30, 0, 0), abs=1e-9)
    else:
        assert first.range_m == pytest.approx(10)


def test_schema_accepts_the_built_in_files_and_refuses_a_stranger():
    validator = jsonschema.Draft202012Validator(all_schemas()["scenario"])
    validator.check_schema(all_schemas()["scenario"])
    for name in list_scenarios():
        raw = tomllib.loads(files("flyaround.assets").joinpath("scenarios", f"{name}.toml").read_text())
        raw["epoch_utc"] = raw["epoch_utc"].isoformat()
        validator.validate(raw)
    with pytest.raises(jsonschema.ValidationError):
        validator.validate({**raw, "surprise": 1})


def test_cameras():
    assert {"speed", "square-1024", "paper"} <= set(list_cameras())
    speed = load_camera("speed")
    assert (speed.width_px, speed.height_px, speed.cx_px, speed.cy_px) == (1920, 1200, 960, 600)
    assert speed.fx_px == pytest.approx(0.0176 / 5.86e-6)
    square = load_camera("square-1024")
    assert (square.fx_px, square.cx_px) == (speed.fx_px, 511.5)


def test_frame_times():
    assert frame_times(60, 4).tolist() == [0, 20, 40, 60]
    assert frame_times(60, 1).tolist() == [0]
    assert frame_times(60, 3, 10).tolist() == [0, 10, 20]
    assert frame_times(60, every_s=0.1).size == 601
    assert frame_times(60, every_s=0.1)[-1] <= 60
    assert frame_times(60, every_s=7).tolist() == [0, 7, 14, 21, 28, 35, 42, 49, 56]
    for n, every in ((0, None), (8, 10.0), (3, -1.0), (3, float("nan"))):
        with pytest.raises(UserError, match=r"allowed|do not fit"):
            frame_times(60, n, every)
    # the limit counts the frames that are taken
    assert frame_times(60, 10, 1e-9)[-1] == pytest.approx(9e-9)
    assert frame_times(1e300, 2, 1e-300).size == 2
    assert frame_times(MAX_FRAMES - 1, every_s=1.0).size == MAX_FRAMES
    with pytest.raises(UserError, match=f"more than {MAX_FRAMES}"):
        frame_times(MAX_FRAMES, every_s=1.0)


@pytest.mark.parametrize("duration_s", [0.0, -1.0, float("nan"), float("inf")])
def test_a_flight_needs_a_positive_duration(duration_s):
    with pytest.raises(UserError, match="more than 0"):
        fly(load_scenario("tango-eclipse-pass"), BOX, duration_s)


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_named_environments_and_what_the_file_says_over_them(name, tmp_path):
    def environment_of(lines):
        text = GOOD.replace("stars = true", lines)
        return load_scenario(write(tmp_path, text)).environment.layers()

    named = environment_of(f'preset = "{name}"')
    assert named == ENVIRONMENTS[name]
    section = environment_section(name)
    assert all(getattr(section, f.name) == getattr(named, f.name) for f in msgspec.structs.fields(named))
    assert environment_of(f'preset = "{name}"\natmosphere_thickness_km = 100.0') == msgspec.structs.replace(
        named, atmosphere_thickness_km=100.0
    )
