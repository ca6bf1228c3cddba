"""The plan of a recipe: samples by number, each of which depends on (recipe, seed, number) only."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from flyaround.simulator.camera.lens.files import read_camera_file
from flyaround.simulator.errors import UserError
from flyaround.simulator.imaging.metering import metered_exposure_s
from flyaround.simulator.recipes.backgrounds import draw_view
from flyaround.simulator.recipes.clearance import is_clear, share_inside
from flyaround.simulator.recipes.flown import flight_scene
from flyaround.simulator.recipes.poses import DrawnPose, draw_pose, radius_m, resolve_range
from flyaround.simulator.recipes.sky import choose_sky, place_in_sky, sun_and_nadir
from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.scenario.load import load_recipe
from flyaround.simulator.scenario.plan import DocumentPlan, check_plan_options
from flyaround.simulator.scenario.poses import read_poses
from flyaround.simulator.scenario.random_draws import numbered_generator
from flyaround.simulator.scenario.recipe import (
    AboutTrajectory,
    FacingAttitude,
    PoseList,
    Recipe,
    Sequences,
    UniformRange,
)
from flyaround.simulator.scene.environments import Environment, environment_preset
from flyaround.simulator.scene.illumination.bands import Bands
from flyaround.simulator.scene.sample import PairMember, Sample
from flyaround.simulator.scene.state import Quality, SceneState, TargetRef
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.targets.model import Target
from flyaround.simulator.world.ephemeris.eclipse import sun_fraction_past_bodies
from flyaround.simulator.world.frames.pose import Pose
from flyaround.simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from numpy.random import Generator

    from flyaround.simulator.recipes.sky import PlaceInSky
    from flyaround.simulator.scenario.recipe import Background
    from flyaround.simulator.scene.sample import BackgroundView

_SAMPLE_STREAM, _VIEW_STREAM = 0x5CE2E, 0xBAC60
"""Random streams of the samples, and of the choice of backgrounds."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RecipePlan(DocumentPlan):
    """Samples of a recipe.

    Parameters
    ----------
    recipe : Recipe
        The recipe.
    n_frames : int
        Number of samples.
    environment : Environment, optional
        Replaces the recipe's layers of the world.
    """

    recipe: Recipe
    n_frames: int
    environment: Environment | None = None

    @property
    def document(self) -> Recipe:
        """The recipe."""
        return self.recipe

    def planned_scene(self, k: int) -> SceneState:
        """Return the scene of sample k before variation.

        Returns
        -------
        SceneState
            Scene with ``k`` as frame number; of a pair, the pose and sky of the pair in the environment of the
            member.
        """
        pairs = self.recipe.pairs
        if pairs is None:
            return self._sample(k, k)
        pair, member = divmod(k, len(pairs.environments))
        name = pairs.environments[member]
        scene = self._sample(pair, k)
        return _with_sample(
            replace(scene, environment=environment_preset(name)), pair=PairMember(pair=pair, environment=name)
        )

    def next_scene(self, k: int) -> SceneState | None:
        """Return the next scene in sample k's sequence.

        Returns
        -------
        SceneState or None
            Scene of sample k + 1; None after the last one of the sequence or the recipe, and for independent
            samples and pairs.
        """
        poses = self.recipe.poses
        if not isinstance(poses, Sequences) or self.recipe.pairs is not None:
            return None
        return self.scene(k + 1) if k + 1 < self.n_frames and (k + 1) % poses.frames else None

    def library(self, views: int | None = None) -> Background:
        """Return the recipe's library of backgrounds, or its first views.

        Returns
        -------
        Background
            The recipe's library, or a copy with ``views`` views. View k is the same in both.

        Raises
        ------
        UserError
            If it has none, or too few views.
        """
        library = self.recipe.background
        if library is None:
            raise UserError(f"recipe {self.recipe.name} has no section [background]; name another recipe")
        if views is not None and views > library.views:
            raise UserError(
                f"recipe {self.recipe.name}: {views} views are requested, but its library has {library.views}; request "
                "less, or raise views in its section [background]"
            )
        return library if views is None else msgspec.structs.replace(library, views=views)

    def scene_before(self, library: Background, number: int) -> SceneState:
        """Return a scene in front of one view of a library.

        Returns
        -------
        SceneState
            Scene with ``number`` as frame number, and the target unrotated on the camera's axis at 1 km.
        """
        pose = DrawnPose(np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 1000.0]))
        return self._placed_scene(number, pose, draw_view(library, self.camera, number).place)

    def _sample(self, k: int, frame_index: int) -> SceneState:
        """Return sample k, with another frame number."""
        rng = numbered_generator(self.seed, k, _SAMPLE_STREAM)
        recipe = self.recipe
        if isinstance(recipe.poses, AboutTrajectory | Sequences):
            scene = flight_scene(rng, recipe, self.target, self.seed, k, self.n_frames)
            scene = replace(scene, seed=self.seed, bands=self.bands, quality=self.quality, camera=self.camera)
            scene = scene if self.environment is None else replace(scene, environment=self.environment)
            return replace(scene, frame_index=frame_index)
        if isinstance(recipe.poses, PoseList):
            pose = _read_pose_list(recipe.poses.file)[k]
            redraws: dict[str, int] = {}
            drawn = DrawnPose(np.asarray(pose.q_wxyz), np.asarray(pose.t_m))
        else:
            drawn, redraws = self._constrained_pose(rng, k)
        view: BackgroundView | None = None
        if recipe.background is not None:
            library = recipe.background
            among = numbered_generator(self.seed, k, _VIEW_STREAM)
            behind = draw_view(library, self.camera, int(among.integers(library.views)))
            place, view = behind.place, behind.reference
        else:
            sky = choose_sky(rng, recipe.sky)
            place = place_in_sky(rng, sky, drawn.t_camera_from_target_m, *sun_and_nadir(rng, sky))
        scene = self._placed_scene(frame_index, drawn, place)
        return _with_sample(scene, redraws=redraws, raw=drawn.raw, background=view)

    def _constrained_pose(self, rng: Generator, k: int) -> tuple[DrawnPose, dict[str, int]]:
        """Return the first pose that satisfies the constraints, and the number of violations of each."""
        c = self.recipe.constraints
        redraws = {name: 0 for name in ("clearance_m", "origin_in_image", "inside") if getattr(c, name)}
        while True:
            drawn = draw_pose(rng, self.recipe, self.camera, self.target, k)
            violated = self._violated_constraint(drawn)
            if violated is None:
                return drawn, redraws
            redraws[violated] += 1
            if sum(redraws.values()) >= c.most_draws:
                worst = max(redraws, key=lambda name: redraws[name])
                raise UserError(
                    f"recipe {self.recipe.name}: {c.most_draws} poses in a row for sample {k} break its constraints, "
                    f"most of them ({redraws[worst]}) {worst} = {_toml(getattr(c, worst))}, with {self.target.name} at "
                    f"{_bounds(self.recipe, self.target)}: widen [range] or [placement], or loosen "
                    f"{worst} in [constraints]"
                )

    def _violated_constraint(self, drawn: DrawnPose) -> str | None:
        """Return the first constraint that a pose violates."""
        c, camera = self.recipe.constraints, self.camera
        pose = Pose.from_arrays(
            "camera", "target", drawn.q_camera_from_target_wxyz, drawn.t_camera_from_target_m
        )
        if c.clearance_m is not None and not is_clear(pose, self.target, c.clearance_m):
            return "clearance_m"
        if c.origin_in_image:
            pixel = camera.project(drawn.t_camera_from_target_m)
            if not np.all((pixel >= -0.5) & (pixel <= [camera.width_px - 0.5, camera.height_px - 0.5])):
                return "origin_in_image"
        if c.inside is not None and share_inside(pose, self.target, camera) < c.inside:
            return "inside"
        return None

    def _placed_scene(self, frame_index: int, drawn: DrawnPose, place: PlaceInSky) -> SceneState:
        q, t, now = drawn.q_camera_from_target_wxyz, drawn.t_camera_from_target_m, place.now
        recipe = self.recipe
        com = place.R_eci_from_camera @ (matrix_from_quat(q) @ np.asarray(self.target.mass.com_m))
        origin = place.origin_eci_m
        if origin is None:
            origin = place.camera_eci_m + place.R_eci_from_camera @ t
        r_target = origin + com
        v = place.velocity_m_s(r_target)
        scene = SceneState(
            epoch_utc=now.iso(),
            t_s=0.0,
            frame_index=frame_index,
            seed=self.seed,
            camera=self.camera,
            sensor=recipe.sensor_model,
            exposure_s=recipe.sensor.exposure_s,
            optics=recipe.optics.optics(),
            shutter=recipe.sensor.shutter_model,
            quality=self.quality,
            bands=self.bands,
            environment=recipe.environment.layers() if self.environment is None else self.environment,
            target=TargetRef(name=self.target.name, sha256=self.target.sha256),
            q_camera_from_target_wxyz=quat(q),
            t_camera_from_target_m=vec3(t),
            omega_target_rad_s=(0.0, 0.0, 0.0),
            v_target_camera_m_s=(0.0, 0.0, 0.0),
            r_camera_eci_m=vec3(place.camera_eci_m),
            v_camera_eci_m_s=vec3(v),
            q_camera_from_eci_wxyz=quat(place.q_camera_from_eci_wxyz),
            omega_camera_rad_s=(0.0, 0.0, 0.0),
            r_target_eci_m=vec3(r_target),
            v_target_eci_m_s=vec3(v),
            r_sun_eci_m=vec3(place.r_sun_eci_m),
            bodies=place.bodies,
            sun_visible_fraction=sun_fraction_past_bodies(place.bodies, r_target, place.r_sun_eci_m),
            central_body=place.body.name,
            lamp=recipe.lamp,
            lights=tuple(recipe.lights) or msgspec.UNSET,
        )
        auto = recipe.auto_exposure
        return (
            scene if auto is None else replace(scene, exposure_s=metered_exposure_s(auto, scene, self.target))
        )


def plan_recipe(
    name: str | Path | Recipe,
    n: int | None = None,
    *,
    seed: int | None = None,
    target: str | None = None,
    bands: Bands | None = None,
    quality: Quality | None = None,
    camera: str | Path | None = None,
    environment: Environment | None = None,
) -> RecipePlan:
    """Plan ``n`` samples of a recipe.

    Parameters
    ----------
    name : str, Path or Recipe
        Name of a built-in recipe, file, or the recipe itself.
    n : int, optional
        Number of samples, by default the recipe's.
    seed : int, optional
        Seed of every random choice; by default the recipe's.
    target : str, optional
        Target to use instead of the recipe's: a name.
    bands : Bands, optional
        Spectral bands; by default the recipe's.
    quality : Quality, optional
        Quality preset; by default the recipe's.
    camera : str or Path, optional
        Camera to use instead of the recipe's: a name or a file.
    environment : Environment, optional
        Replaces the recipe's layers of the world.

    Returns
    -------
    RecipePlan
        Plan whose scenes are drawn when they are asked for.

    Raises
    ------
    UserError
        If there is no recipe of that name, or its bounds are impossible.
    """
    recipe = name if isinstance(name, Recipe) else load_recipe(name)
    if recipe.members:
        raise UserError(
            f"recipe {recipe.name} is {len(recipe.members)} data sets: plan one of {', '.join(recipe.members)}"
        )
    check_plan_options(n, seed, bands, quality)
    if camera is not None:
        recipe = msgspec.structs.replace(recipe, camera=read_camera_file(camera))
    craft = load_target(target or recipe.target)
    # the data set's card records the actual range and target
    recipe = msgspec.structs.replace(
        recipe, target=craft.name if target is None else target, range=resolve_range(recipe.range, craft)
    )
    plan = RecipePlan(
        recipe=recipe,
        target=craft,
        camera=recipe.camera_in(bands or recipe.output.bands),
        n_frames=_count(recipe, n),
        seed=recipe.seed if seed is None else seed,
        bands=bands or recipe.output.bands,
        quality=quality or recipe.output.quality,
        environment=environment,
        vary=recipe.vary,
    )
    _check_range(recipe, craft)
    plan.scene(0)  # raise for an impossible scene before anything is written
    return plan


def _check_range(recipe: Recipe, target: Target) -> None:
    """Raise if a range always puts the camera inside the target.

    Raises
    ------
    UserError
        If it does; the message states the range and the target's size.
    """
    if recipe.poses is not None or isinstance(recipe.attitude, FacingAttitude):
        return
    kind = resolve_range(recipe.range, target)
    # a quarter, because a camera between a boom and the body is not inside
    if isinstance(kind, UniformRange) and kind.far_m < 0.25 * radius_m(target):
        raise UserError(
            f"recipe {recipe.name}: section [range] ends at far_m = {kind.far_m:g}, inside of {target.name}, whose "
            f"mesh reaches {radius_m(target):.3g} m from its origin; make it larger, or choose another --target"
        )


def _count(recipe: Recipe, n: int | None) -> int:
    """Return the number of frames, at most that of a list of poses."""
    if not isinstance(recipe.poses, PoseList):
        return recipe.frames if n is None else n
    n_available = len(_read_pose_list(recipe.poses.file)) * (
        1 if recipe.pairs is None else len(recipe.pairs.environments)
    )
    if n is not None and n > n_available:
        raise UserError(
            f"recipe {recipe.name}: {n} frames are requested, but {recipe.poses.file} has poses for {n_available}; "
            f"give -n {n_available} or less, or a longer list"
        )
    return n_available if n is None else n


@lru_cache(maxsize=2)
def _read_pose_list(file: str) -> tuple[Pose, ...]:
    return read_poses(Path(file))


def _with_sample(scene: SceneState, **fields: Any) -> SceneState:  # noqa: ANN401 - of `Sample`
    """Return the scene with its random sample attached. An empty sample is omitted from the record."""
    before = Sample() if isinstance(scene.sample, msgspec.UnsetType) else scene.sample
    sample = msgspec.structs.replace(before, **fields)
    return scene if sample == Sample() else replace(scene, sample=sample)


def _bounds(recipe: Recipe, target: Target) -> str:
    """Return the range as text."""
    if isinstance(recipe.attitude, FacingAttitude):
        return "the distance at which it fills its place"
    kind = resolve_range(recipe.range, target)
    return f"{kind.near_m:g} to {kind.far_m:g} m"


def _toml(value: object) -> str:
    return {True: "true", False: "false"}.get(value, f"{value}") if isinstance(value, bool) else f"{value:g}"
