"""Views of a target for training, rendered once under several single lights that are mixed later.

Each view shows the whole target in a narrow camera that points at its centre. It is rendered ``LIGHTS`` times: in
sunlight from three directions, with two diffuse boxes and with a lamp, each as strong at the target as the Sun. Light
is additive, so weighted sums represent sunlight as well as laboratory illumination.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from flyaround.hil.evaluate.method_choice import board_model
from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.imaging.exposure import integrate
from flyaround.simulator.imaging.image_formation import expose_scene
from flyaround.simulator.labels.surfaces import surfaces
from flyaround.simulator.recipes.plan import RecipePlan
from flyaround.simulator.recipes.poses import resolve_range
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.scenario.load import load_recipe
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.scene.illumination.area_light import DIFFUSE_DEG, AreaLight
from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_from_matrix

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array, FloatArray
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

# Side of a view [px], and share of it that the bounding sphere fills.
VIEW_PX, FILL_SHARE = 160, 0.97

# Number of lights, the first ``SUNS`` of them the Sun, and their largest angle from the camera's direction [rad].
LIGHTS, SUNS, MAX_LIGHT_ANGLE_RAD = 6, 3, float(np.radians(125.0))

# Area lights: side of a box and of a lamp, and distance from the target [radii]; half angle of a lamp [deg].
BOX_RADII, LAMP_RADII, DISTANCE_RADII, LAMP_DEG = (0.4, 2.3), (0.1, 0.33), (1.3, 5.2), (12.0, 40.0)

# Distance of the Sun [m], and solar irradiance at 1 au [W m-2].
SUN_M, SUN_W_M2 = 1.5e11, 1361.0

# Range of a view [radii of the bounding sphere].
RANGE_RADII = (2.7, 25.0)

# Environment with nothing but the target.
CRAFT_ONLY = Environment(earth=False, stars=False, sun=False, moon=False, planets=False, sea_ice=False)

# Size of a background: the SPEED camera's image at a quarter of its resolution [px].
EARTH_PX = (480, 300)

# Largest surface label.
MAX_LABEL = 256


@dataclass(frozen=True, eq=False)
class View:
    """A target from one viewpoint, under each light separately.

    Parameters
    ----------
    lit : (LIGHTS, S, S) array
        Square root of the signal relative to each light's largest one, scaled to 255.
    scale : (LIGHTS,) array
        Largest signal under each light [full scale].
    cover : (S, S) array
        Share of the pixel covered by the target, scaled to 255.
    label : (S, S) array
        Label of the surface, a side of a part; 0 outside the target.
    q_wxyz : (4,) array
        Attitude of the target relative to the view's camera.
    range_in_radii : float
        Distance of the sphere's centre over its radius.
    """

    lit: ByteArray
    scale: Float32Array
    cover: ByteArray
    label: ByteArray
    q_wxyz: FloatArray
    range_in_radii: float


def focal_length_px(range_in_radii: FloatArray | float, side_px: int = VIEW_PX) -> FloatArray:
    """Return the focal length with which the bounding sphere fills ``FILL_SHARE`` of the view's side [px]."""
    return np.asarray(0.5 * FILL_SHARE * side_px * np.sqrt(np.asarray(range_in_radii) ** 2 - 1.0))


def draw_views(
    renderer: Renderer, paints: Sequence[Target], n: int, seed: int, first: int = 0
) -> Iterator[View]:
    """Render views ``first`` to ``n - 1`` of a target, each a function of the seed and its index only.

    Parameters
    ----------
    renderer : Renderer
        Renderer.
    paints : sequence of Target
        Targets of the same shape with different surfaces, rendered in turn.
    n : int
        Index after the last view.
    seed : int
        Seed of poses and lights.
    first : int
        Index of the first view.
    """
    model = board_model(paints[0])
    plans = [_plan(paint, n, seed, "eval-black") for paint in paints]
    for k in range(first, n):
        rng = np.random.default_rng([seed, k])
        which = k % len(paints)
        distance = float(np.exp(rng.uniform(*np.log(RANGE_RADII))))
        scene = _narrow_camera(plans[which].scene(k), model.centre_m, model.radius_m, distance)
        yield _draw(renderer, scene, paints[which], model.radius_m, distance, rng)


def draw_earths(renderer: Renderer, target: Target, n: int, seed: int) -> Float32Array:
    """Return signals (n, 300, 480) of the Earth without the target, as in the recipe ``eval-earth``."""
    plan = _plan(target, n, seed, "eval-earth")
    out = np.zeros((n, EARTH_PX[1], EARTH_PX[0]), np.float32)
    for k in range(n):
        # move the target out of sight
        scene = replace(plan.scene(k), sensor=sensor_preset("ideal"), t_camera_from_target_m=(0.0, 0.0, 1e6))
        out[k] = np.minimum(expose_scene(scene, integrate(renderer, scene, target).radiance), 8.0)
    return out


def _plan(target: Target, n: int, seed: int, name: str) -> RecipePlan:
    f = 3003.4129692832766 / 4
    camera = Camera(
        width_px=EARTH_PX[0],
        height_px=EARTH_PX[1],
        fx_px=f,
        fy_px=f,
        cx_px=0.5 * (EARTH_PX[0] - 1),
        cy_px=0.5 * (EARTH_PX[1] - 1),
    )
    recipe = load_recipe(name)
    named = msgspec.structs.replace(recipe, target=target.name, range=resolve_range(recipe.range, target))
    return RecipePlan(recipe=named, target=target, camera=camera, n_frames=n, seed=seed)


def _narrow_camera(
    scene: SceneState, centre_m: FloatArray, radius_m: float, range_in_radii: float
) -> SceneState:
    """Return the scene in a camera that points at the target's centre and is filled by its bounding sphere."""
    f = float(focal_length_px(range_in_radii))
    middle = 0.5 * (VIEW_PX - 1)
    camera = Camera(width_px=VIEW_PX, height_px=VIEW_PX, fx_px=f, fy_px=f, cx_px=middle, cy_px=middle)
    R = matrix_from_quat(scene.q_camera_from_target_wxyz)
    t = np.array([0.0, 0.0, range_in_radii * radius_m]) - R @ centre_m
    return replace(
        scene,
        camera=camera,
        sensor=sensor_preset("ideal"),
        environment=CRAFT_ONLY,
        quality="draft",
        t_camera_from_target_m=vec3(t),
    )


def _draw(
    renderer: Renderer,
    scene: SceneState,
    target: Target,
    radius_m: float,
    range_in_radii: float,
    rng: np.random.Generator,
) -> View:
    lit = np.empty((LIGHTS, VIEW_PX, VIEW_PX), np.uint8)
    scale = np.empty(LIGHTS, np.float32)
    layers = surfaces(renderer, scene, target, layers=True)
    if layers.parts is None or layers.normals is None:
        raise RuntimeError("the label raster lacks parts or normals")
    is_target = np.isfinite(layers.depth_m)
    for j, direction in enumerate(_directions(rng)):
        lamp = j == LIGHTS - 1
        near = (
            _lit_by_sun(scene, direction)
            if j < SUNS
            else _lit_by_lamp(scene, direction, radius_m, rng, lamp=lamp)
        )
        signal = (
            np.asarray(expose_scene(near, integrate(renderer, near, target).radiance), np.float32) * is_target
        )
        top = max(float(signal.max()), 1e-6)
        # square roots, because eight bits must resolve dark parts as well
        lit[j], scale[j] = np.rint(255 * np.sqrt(np.maximum(signal / top, 0))), top
    label = _surface_labels(layers.parts, layers.normals) % MAX_LABEL
    q = np.asarray(quat_from_matrix(matrix_from_quat(scene.q_camera_from_target_wxyz)), float)
    return View(
        lit, scale, np.where(is_target, 255, 0).astype(np.uint8), label.astype(np.uint8), q, range_in_radii
    )


def _lit_by_sun(scene: SceneState, direction: FloatArray) -> SceneState:
    """Return the scene lit only by the Sun from a direction in the camera frame."""
    R = matrix_from_quat(scene.q_camera_from_eci_wxyz)
    sun = np.asarray(scene.r_target_eci_m) + SUN_M * (R.T @ direction)
    return replace(scene, r_sun_eci_m=vec3(sun), sun_visible_fraction=1.0)


def _lit_by_lamp(
    scene: SceneState, direction: FloatArray, radius_m: float, rng: np.random.Generator, *, lamp: bool
) -> SceneState:
    """Return the scene lit only by an area light in a direction of the camera frame, seen from the target."""
    origin = np.asarray(scene.t_camera_from_target_m)
    distance_m = radius_m * float(rng.uniform(*DISTANCE_RADII))
    width, height = radius_m * rng.uniform(*(LAMP_RADII if lamp else BOX_RADII), size=2)
    light = AreaLight(
        position_m=vec3(origin + distance_m * direction),
        width_m=float(width),
        height_m=float(height),
        turn_deg=float(rng.uniform(0, 180)),
        radiance_w_m2_sr=float(SUN_W_M2 * distance_m**2 / (width * height)),
        half_angle_deg=float(rng.uniform(*LAMP_DEG)) if lamp else DIFFUSE_DEG,
    )
    dark = msgspec.structs.replace(scene.environment, sunlight=False, earthshine=False)
    return replace(scene, lights=(light,), environment=dark)


def _directions(rng: np.random.Generator) -> FloatArray:
    """Return unit vectors (LIGHTS, 3) towards the lights, camera axes, uniform within ``MAX_LIGHT_ANGLE_RAD``."""
    cosine = rng.uniform(np.cos(MAX_LIGHT_ANGLE_RAD), 1.0, LIGHTS)
    turn = rng.uniform(0, 2 * np.pi, LIGHTS)
    sine = np.sqrt(1 - cosine**2)
    return np.stack([sine * np.cos(turn), sine * np.sin(turn), -cosine], axis=1)


def _surface_labels(parts: NDArray[np.uint16], normals: NDArray[np.float16]) -> NDArray[np.uint16]:
    """Return a label per side of a part, by its quantised normal in the camera's axes."""
    n = np.rint(1.5 * normals.astype(np.float32)).astype(np.int32)
    side = (n[..., 0] + 2) * 25 + (n[..., 1] + 2) * 5 + n[..., 2] + 2
    _, number = np.unique(parts.astype(np.int64) * 125 + side, return_inverse=True)
    return np.where(parts > 0, number.reshape(parts.shape) + 1, 0).astype(np.uint16)
