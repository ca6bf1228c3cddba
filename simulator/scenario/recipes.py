"""Recipes: independent samples of scenes for training and evaluation, each from (recipe, seed, k) alone.

A sample is drawn in camera axes (pose, Sun, nadir) and then placed in the real sky: a random moment of the
year, the Sun where it is, and the target above the point of the Earth that gives the drawn angle between Sun
and nadir.

Every built-in target has a recipe `eval-black-NAME`. Its range is 3 to 18 m times the ratio of the target's size to
Tango's, so that both span the same sizes in the image; size is half the diagonal of the box about the mesh.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from simulator.camera.detector.presets import sensor_preset
from simulator.camera.lens.camera_model import Camera
from simulator.camera.lens.files import load_camera
from simulator.errors import UserError
from simulator.runtime.arrays import FloatArray, quat, vec3
from simulator.scenario.board_poses import board_pose
from simulator.scene.environments import Environment
from simulator.scene.illumination.bands import Bands
from simulator.scene.state import Quality, SceneState, TargetRef
from simulator.targets.library import list_targets, load_target
from simulator.targets.model import Target
from simulator.world.constants import EARTH_RADIUS_M, MU_EARTH_M3_S2
from simulator.world.ephemeris.earth_orientation import q_itrs_from_eci
from simulator.world.ephemeris.eclipse import sun_fraction_past_earth_and_moon
from simulator.world.ephemeris.moon_orientation import q_moon_from_eci
from simulator.world.ephemeris.sun_moon import moon_eci_m, sun_eci_m
from simulator.world.frames.rotation import matrix_from_quat, quat_from_matrix
from simulator.world.time.instant import Instant

if TYPE_CHECKING:
    from numpy.random import Generator

YEAR_START_UTC = "2026-01-01T00:00:00Z"
EVERYTHING = Environment()
YEAR_S = 365.0 * 86400.0
MAX_DRAWS = 1000
HIGH_SUN = 0.2
"""Sine of the Sun's elevation above which no air dims it: boards are lit evenly."""
TANGO_RANGE_M = (3.0, 18.0)
TANGO_SIZE_M = 0.80320
"""Half the diagonal of the box about Tango."""


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """What is drawn, and from where to where.

    Parameters
    ----------
    range_m : camera to model origin along the camera's z (in flight a range is to the centre of mass), uniform; None
        for Tango's range in proportion to the target's size.
    max_phase_deg : largest angle at the target between Sun and camera; directions uniform in solid angle.
    nadir_off_boresight_deg : angle between boresight and nadir, uniform in solid angle. 64 degrees puts the limb
        of the Earth on the boresight at 700 km.
    night_share : share of samples whose ground below is dark.
    facing_deg : for flat boards: the model's +z looks at the camera within this angle, the board is upright within 20
        degrees, wholly in the image and as large as fits its place; ``range_m`` then has no part. None: any attitude.
    """

    name: str
    title: str
    sensor: str
    nadir_off_boresight_deg: tuple[float, float]
    target: str = "tango"
    camera: str = "speed"
    range_m: tuple[float, float] | None = TANGO_RANGE_M
    max_phase_deg: float = 120.0
    night_share: float = 0.1
    altitude_m: float = 700e3
    exposure_s: float = 0.001
    facing_deg: float | None = None


BASIC = (
    Recipe(
        name="eval-black",
        title="Evaluation: 3-18 m, black space behind, SPEED noise",
        sensor="speed",
        nadir_off_boresight_deg=(90.0, 180.0),
    ),
    Recipe(
        name="eval-earth",
        title="Evaluation: 3-18 m, Earth behind part or all of the frame, thesis noise",
        sensor="thesis",
        nadir_off_boresight_deg=(0.0, 66.0),
    ),
    Recipe(
        name="thesis",
        title="The thesis: tango-thesis at 3-18 m, Earth behind, thesis noise",
        target="tango-thesis",
        sensor="thesis",
        nadir_off_boresight_deg=(0.0, 66.0),
    ),
)
CALIBRATION = tuple(
    Recipe(
        name=name,
        title=f"Calibration: the {pattern} board all over the field of view, space behind, no noise",
        target=target,
        camera="square-1024",
        sensor="ideal",
        nadir_off_boresight_deg=(85.0, 100.0),
        max_phase_deg=25.0,
        night_share=0.0,
        exposure_s=0.0006,
        facing_deg=45.0,
    )
    for name, pattern, target in (
        ("calibration", "ChArUco", "calibration-board"),
        ("calibration-chessboard", "chessboard", "chessboard"),
    )
)
RECIPES = (
    *BASIC,
    *CALIBRATION,
    *(
        replace(
            BASIC[0],
            name=f"{BASIC[0].name}-{name}",
            title=f"Evaluation: {name} in black space, as large in the image as Tango, SPEED noise",
            target=name,
            range_m=None,
        )
        for name in list_targets()
    ),
)


def list_recipes() -> tuple[str, ...]:
    """Names of the recipes."""
    return tuple(r.name for r in RECIPES)


@dataclass(frozen=True, eq=False, kw_only=True)
class RecipePlan:
    """``n_frames`` independent samples; the same face as ``simulator.scenario.plan.Plan`` to a capture."""

    recipe: Recipe
    target: Target
    camera: Camera
    n_frames: int
    seed: int
    bands: Bands = "mono"
    quality: Quality = "default"
    environment: Environment = EVERYTHING
    every_s: float | None = None

    @property
    def scenario_name(self) -> str:
        """Name of the recipe."""
        return self.recipe.name

    @property
    def labels(self) -> tuple[str, ...]:
        """No layers unless they are asked for."""
        return ()

    @property
    def scenario_document(self) -> dict[str, Any]:
        """The recipe as a JSON-able document."""
        return {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(self.recipe).items()}

    def scene(self, k: int) -> SceneState:
        """Sample k."""
        rng = np.random.Generator(np.random.SFC64(np.random.SeedSequence(self.seed, spawn_key=(k, 0x5CE2E))))
        r = self.recipe
        if r.facing_deg is not None:
            q, t = board_pose(rng, self.camera, self.target, k, r.facing_deg)
        else:
            z = float(rng.uniform(*(r.range_m or scaled_range_m(self.target))))
            q = _uniform_attitude(rng)
            t = _translation_in_view(rng, self.camera, _radius_m(self.target), z)
        sun, nadir = _sun_and_nadir(rng, r)
        return self._placed_in_the_sky(rng, k, q, t, sun, nadir)

    def next_scene(self, _k: int) -> SceneState | None:
        """None: samples are independent."""
        return None

    def _placed_in_the_sky(
        self, rng: Generator, k: int, q: FloatArray, t: FloatArray, sun: FloatArray, nadir: FloatArray
    ) -> SceneState:
        now = Instant.from_utc(YEAR_START_UTC).plus(float(np.floor(rng.uniform(0, YEAR_S))))
        r_sun, r_moon = sun_eci_m(now.tt1, now.tt2), moon_eci_m(now.tt1, now.tt2)
        to_sun = r_sun / np.linalg.norm(r_sun)
        # the target's zenith stands at the drawn angle from the Sun, at a random azimuth about it
        side = np.cross(to_sun, _uniform_direction(rng))
        side /= np.linalg.norm(side)
        cosine = float(-nadir @ sun)
        up = cosine * to_sun + np.sqrt(max(1 - cosine**2, 0.0)) * side
        R_eci_from_camera = _triad(to_sun, -up) @ _triad(sun, nadir).T
        R_camera_from_eci = R_eci_from_camera.T
        origin = (EARTH_RADIUS_M + self.recipe.altitude_m) * up
        com = R_eci_from_camera @ (matrix_from_quat(q) @ np.asarray(self.target.mass.com_m))
        r_target = origin + com
        speed = np.sqrt(MU_EARTH_M3_S2 / np.linalg.norm(r_target))
        along = np.cross(up, _uniform_direction(rng))
        v = speed * along / np.linalg.norm(along)
        q_ie = q_itrs_from_eci(now)
        return SceneState(
            epoch_utc=now.iso(),
            t_s=0.0,
            frame_index=k,
            seed=self.seed,
            camera=self.camera,
            sensor=sensor_preset(self.recipe.sensor),
            exposure_s=self.recipe.exposure_s,
            quality=self.quality,
            bands=self.bands,
            environment=self.environment,
            target=TargetRef(name=self.target.name, sha256=self.target.sha256),
            q_camera_from_target_wxyz=quat(q),
            t_camera_from_target_m=vec3(t),
            omega_target_rad_s=(0.0, 0.0, 0.0),
            v_target_camera_m_s=(0.0, 0.0, 0.0),
            r_camera_eci_m=vec3(origin - R_eci_from_camera @ t),
            v_camera_eci_m_s=vec3(v),
            q_camera_from_eci_wxyz=quat(quat_from_matrix(R_camera_from_eci)),
            omega_camera_rad_s=(0.0, 0.0, 0.0),
            r_target_eci_m=vec3(r_target),
            v_target_eci_m_s=vec3(v),
            r_sun_eci_m=vec3(r_sun),
            r_moon_eci_m=vec3(r_moon),
            q_itrs_from_eci_wxyz=quat(q_ie),
            q_moon_from_eci_wxyz=quat(q_moon_from_eci(now)),
            sun_visible_fraction=sun_fraction_past_earth_and_moon(
                r_target, r_sun, r_moon, matrix_from_quat(q_ie)[2]
            ),
        )


def plan_recipe(
    name: str,
    n: int,
    *,
    seed: int | None = None,
    bands: Bands | None = None,
    quality: Quality | None = None,
    camera: str | Path | None = None,
    environment: Environment | None = None,
) -> RecipePlan:
    """A plan of ``n`` samples of a recipe.

    Parameters
    ----------
    camera : name or file of a camera to use instead of the recipe's. environment : layers of the world, all by default.

    Raises
    ------
    UserError
        If there is no recipe of that name.
    """
    for recipe in RECIPES:
        if recipe.name == name:
            target = load_target(recipe.target)
            return RecipePlan(
                # the range that was drawn from stands in the data set's card
                recipe=replace(
                    recipe,
                    range_m=recipe.range_m or scaled_range_m(target),
                    camera=str(camera or recipe.camera),
                ),
                target=target,
                camera=load_camera(camera or recipe.camera),
                n_frames=n,
                seed=0 if seed is None else seed,
                bands=bands or "mono",
                quality=quality or "default",
                environment=environment or EVERYTHING,
            )
    known = ", ".join(r.name for r in (*BASIC, *CALIBRATION))
    raise UserError(
        f"there is no recipe '{name}'; choose from {known}, or eval-black-NAME of a built-in target"
    )


def scaled_range_m(target: Target) -> tuple[float, float]:
    """Where a target is as large in the image as Tango at 3 and at 18 m [m], from the size of its mesh."""
    corners = np.concatenate([(p.positions_m.min(axis=0), p.positions_m.max(axis=0)) for p in target.parts])
    size_m = float(np.linalg.norm(np.ptp(corners.astype(float), axis=0))) / 2
    near, far = (round(r * size_m / TANGO_SIZE_M, 3) for r in TANGO_RANGE_M)
    return near, far


@lru_cache(maxsize=4)
def _radius_m(target: Target) -> float:
    return float(max(np.linalg.norm(p.positions_m, axis=1).max() for p in target.parts))


def _uniform_attitude(rng: Generator) -> FloatArray:
    """Uniform on SO(3): a normalised 4-vector of normals (Marsaglia 1972), with w >= 0."""
    q = rng.standard_normal(4)
    q /= np.linalg.norm(q)
    return np.asarray(q if q[0] >= 0 else -q, float)


def _uniform_direction(rng: Generator) -> FloatArray:
    v = rng.standard_normal(3)
    return np.asarray(v / np.linalg.norm(v), float)


def _translation_in_view(rng: Generator, camera: Camera, radius_m: float, z: float) -> FloatArray:
    """Model origin at depth z, its bounding sphere inside the image; on the axis where it is larger."""
    radius_px = camera.fx_px * radius_m / z
    size = np.array([camera.width_px, camera.height_px])
    slack = np.maximum(size / 2 - radius_px, 0)
    pixel = (size - 1) / 2 + rng.uniform(-1, 1, 2) * slack
    x = (pixel[0] - camera.cx_px) / camera.fx_px * z
    y = (pixel[1] - camera.cy_px) / camera.fy_px * z
    return np.array([x, y, z])


def _sun_and_nadir(rng: Generator, recipe: Recipe) -> tuple[FloatArray, FloatArray]:
    """Directions to the Sun and to nadir in camera axes; the target is always sunlit.

    The phase angle is measured at the target from the boresight reversed; the nadir's angle from the boresight.
    """
    night = rng.random() < recipe.night_share
    dip = np.sin(np.arccos(EARTH_RADIUS_M / (EARTH_RADIUS_M + recipe.altitude_m)))
    for _ in range(MAX_DRAWS):
        sun = _in_cone(rng, np.array([0.0, 0.0, -1.0]), 0.0, recipe.max_phase_deg)
        nadir = _in_cone(rng, np.array([0.0, 0.0, 1.0]), *recipe.nadir_off_boresight_deg)
        elevation = float(-nadir @ sun)  # sine of the Sun's elevation above the target's horizon
        lowest = -0.9 * dip if recipe.facing_deg is None else HIGH_SUN
        if (elevation < 0.0) == night and elevation > lowest:
            return sun, nadir
    raise RuntimeError(f"recipe {recipe.name} leaves no room for a sunlit sample")


def _in_cone(rng: Generator, axis: FloatArray, low_deg: float, high_deg: float) -> FloatArray:
    """Uniform in solid angle between two angles from an axis along z."""
    c = rng.uniform(np.cos(np.radians(high_deg)), np.cos(np.radians(low_deg)))
    azimuth = rng.uniform(0, 2 * np.pi)
    s = np.sqrt(1 - c**2)
    return np.array([s * np.cos(azimuth), s * np.sin(azimuth), c * axis[2]])


def _triad(first: FloatArray, second: FloatArray) -> FloatArray:
    """Right-handed axes (columns): the first direction, and the second made normal to it."""
    b = second - (second @ first) * first
    b /= np.linalg.norm(b)
    return np.stack([first, b, np.cross(first, b)], axis=1)
