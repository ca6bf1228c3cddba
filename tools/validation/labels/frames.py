"""Random scenes for testing labels: any target, lens, detector, lighting and motion, as a function of (seed, k)."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from flyaround.simulator.camera.detector.presets import list_sensor_presets
from flyaround.simulator.camera.detector.shutter import Shutter
from flyaround.simulator.camera.lens.camera_model import Camera, Distortion, camera_problem
from flyaround.simulator.labels.request import LAYERS, LabelRequest
from flyaround.simulator.labels.truth import FlowLabel
from flyaround.simulator.recipes.plan import RecipePlan
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.scenario.document import SensorSection
from flyaround.simulator.scenario.recipe import Recipe, Sky, UniformRange
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.scene.motion import propagated_scene
from flyaround.simulator.targets.library import list_targets, load_target
from flyaround.simulator.world.constants import AU_M
from flyaround.simulator.world.ephemeris.eclipse import sun_fraction_past_bodies
from flyaround.simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from numpy.random import Generator

    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

BLACK = Environment(earth=False, stars=False, sun=False, moon=False, earthshine=False)
FLOW_S = 1.0  # time to the frame of the optical flow


@lru_cache(maxsize=64)
def cached_target(name: str) -> Target:
    """Return a target for many frames, cached."""
    return load_target(name)


def random_frame(seed: int, k: int) -> tuple[SceneState, LabelRequest]:
    """Return the scene and label request of frame k."""
    rng = np.random.Generator(np.random.SFC64(np.random.SeedSequence(seed, spawn_key=(k, 0x7AB))))
    names = list_targets()
    # mostly the lowest level of detail: fewer triangles, the same labelling code
    level = "@low" if rng.random() < 0.97 else ""
    target = cached_target(names[int(rng.integers(len(names)))] + level)
    camera = _camera(rng)
    preset = str(rng.choice(list_sensor_presets()))
    near_m, far_m = _range_m(rng, target, camera)
    recipe = Recipe(
        name="random",
        title="random",
        target=target.name,
        range=UniformRange(near_m=near_m, far_m=far_m),
        sky=[Sky(nadir_off_boresight_deg=(0.0, 180.0), max_phase_deg=180.0, night_share=0.3)],
        sensor=msgspec.convert({"preset": preset, "exposure_s": 10 ** rng.uniform(-4, -2)}, SensorSection),
    )
    plan = RecipePlan(
        recipe=recipe,
        target=target,
        camera=camera,
        n_frames=k + 1,
        seed=seed,
        bands="rgb" if rng.random() < 0.1 else "mono",
        quality="default" if rng.random() < 0.1 else "draft",
    )
    scene = _moving(rng, _off_centre(rng, _in_other_light(rng, plan.scene(k))))
    if rng.random() < 0.5:
        scene = replace(scene, environment=BLACK)
    scene = replace(scene, shutter=_shutter(rng))
    layers = tuple(name for name in LAYERS if rng.random() < 0.8)
    if scene.shutter.is_rolling:
        layers = tuple(name for name in layers if name != "flow")
    later = propagated_scene(scene, FLOW_S)
    flow = FlowLabel(
        t_s=later.t_s,
        q_camera_from_target_wxyz=later.q_camera_from_target_wxyz,
        t_camera_from_target_m=later.t_camera_from_target_m,
    )
    return scene, LabelRequest(layers=layers, flow=flow if "flow" in layers else None)


def _camera(rng: Generator) -> Camera:
    """Return a camera of 8 to 70 degrees, at random with distortion, off-centre principal point, non-square pixels."""
    for _ in range(100):
        width, height = int(rng.integers(64, 161)), int(rng.integers(48, 129))
        f = width / 2 / np.tan(np.radians(rng.uniform(8, 70)) / 2)
        model = rng.choice(["none", "brown_conrady", "kannala_brandt"], p=[0.65, 0.2, 0.15])
        distortion = Distortion()
        if model == "brown_conrady":
            k = (rng.uniform(-0.3, 0.3), rng.uniform(-0.1, 0.1), *rng.uniform(-0.002, 0.002, 2), 0.0)
            distortion = Distortion("brown_conrady", tuple(float(x) for x in k))
        elif model == "kannala_brandt":
            distortion = Distortion("kannala_brandt", tuple(float(x) for x in rng.uniform(-0.03, 0.03, 4)))
        camera = Camera(
            width_px=width,
            height_px=height,
            fx_px=float(f),
            fy_px=float(f * rng.uniform(0.95, 1.05)),
            cx_px=float((width - 1) / 2 + rng.uniform(-0.1, 0.1) * width),
            cy_px=float((height - 1) / 2 + rng.uniform(-0.1, 0.1) * height),
            distortion=distortion,
        )
        if camera_problem(camera) is None:
            return camera
    raise RuntimeError("no usable lens in a hundred random draws")


def _range_m(rng: Generator, target: Target, camera: Camera) -> tuple[float, float]:
    """Return the limits of the range at which the craft spans 0.1 to 1.6 image heights with the camera outside it."""
    radius = float(max(np.linalg.norm(p.positions_m, axis=1).max() for p in target.parts))
    size = 10 ** rng.uniform(-1, 0.2)
    z = max(2 * radius * camera.fy_px / (size * camera.height_px), 1.3 * radius)
    return z, z * 1.01


def _off_centre(rng: Generator, scene: SceneState) -> SceneState:
    """Return the scene; in every third one the craft is moved across the image border."""
    if rng.random() > 1 / 3:
        return scene
    c, t = scene.camera, np.asarray(scene.t_camera_from_target_m)
    pixel = rng.uniform(-0.1, 1.1, 2) * [c.width_px, c.height_px]
    pixel = np.clip(pixel, 0, [c.width_px - 1, c.height_px - 1])
    moved = np.array([*(c.unproject(pixel) * t[2]), t[2]])
    R = matrix_from_quat(scene.q_camera_from_eci_wxyz)
    return replace(
        scene,
        t_camera_from_target_m=vec3(moved),
        r_camera_eci_m=vec3(np.asarray(scene.r_camera_eci_m) + R.T @ (t - moved)),
    )


def _in_other_light(rng: Generator, scene: SceneState) -> SceneState:
    """Return the scene; in every tenth one the Sun is in a random direction, possibly behind the Earth."""
    if rng.random() > 0.1:
        return scene
    d = rng.standard_normal(3)
    sun = np.asarray(scene.r_target_eci_m) + AU_M * d / np.linalg.norm(d)
    share = sun_fraction_past_bodies(scene.bodies, scene.r_target_eci_m, sun)
    return replace(scene, r_sun_eci_m=vec3(sun), sun_visible_fraction=share)


def _moving(rng: Generator, scene: SceneState) -> SceneState:
    """Return the scene with a tumble of up to 5 deg s-1 and a drift of up to 5 cm s-1."""
    spin = rng.standard_normal(3)
    spin *= np.radians(rng.uniform(0, 5)) / np.linalg.norm(spin)
    drift = rng.standard_normal(3)
    drift *= rng.uniform(0, 0.05) / np.linalg.norm(drift)
    return replace(
        scene,
        omega_target_rad_s=vec3(spin),
        v_target_eci_m_s=vec3(np.asarray(scene.v_camera_eci_m_s) + drift),
        v_target_camera_m_s=vec3(_velocity(scene, spin, drift)),
    )


def _velocity(scene: SceneState, spin: np.ndarray, drift: np.ndarray) -> np.ndarray:
    """Return the velocity of the model's origin: that of the centre of mass plus rotation, camera frame [m s-1]."""
    R_ce = matrix_from_quat(scene.q_camera_from_eci_wxyz)
    R_ct = matrix_from_quat(scene.q_camera_from_target_wxyz)
    com = R_ce @ np.subtract(scene.r_target_eci_m, scene.r_camera_eci_m)
    origin = R_ct.T @ (np.asarray(scene.t_camera_from_target_m) - com)
    return np.asarray(R_ce @ drift + R_ct @ np.cross(spin, origin))


def _shutter(rng: Generator) -> Shutter:
    """Return a shutter: rolling with probability 1/30, otherwise global."""
    if rng.random() < 1 / 30:
        return Shutter(kind="rolling", readout_s=float(rng.uniform(0.01, 0.5)))
    return Shutter()
