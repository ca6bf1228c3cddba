"""Domain randomisation: seeded random variation of the frames of a plan, recorded in their truth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.scenario.random_draws import direction_about_z, numbered_generator, uniform_direction
from flyaround.simulator.scenario.vary import Vary, VaryBoxes, VaryCraft
from flyaround.simulator.scene.environments import environment_preset
from flyaround.simulator.scene.illumination.area_light import AreaLight, light_axes
from flyaround.simulator.scene.illumination.lamp import Lamp
from flyaround.simulator.scene.sample import Sample, VariedBy
from flyaround.simulator.scene.state import TargetRef
from flyaround.simulator.targets.varied import CraftVariation, SurfaceVariation, varied_target

if TYPE_CHECKING:
    from numpy.random import Generator

    from flyaround.simulator.camera.detector.sensor import Sensor
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

_FRAME_STREAM, _CRAFT_STREAM = 0xF2A3E, 0xC2AF7
"""Random streams: for frames, and for the craft that several frames share."""


@dataclass(frozen=True, eq=False)
class FrameVariation:
    """Random variation of the frames of a plan. Frame k depends only on ranges, seed, target and k.

    Parameters
    ----------
    vary : Vary
        Ranges of the varied quantities.
    seed : int
        Seed of the random generators.
    target : Target
        Model of the unvaried target.
    """

    vary: Vary
    seed: int
    target: Target

    def scene(self, scene: SceneState, k: int) -> SceneState:
        """Return the varied scene of frame k.

        Raises
        ------
        UserError
            If a black level is varied of a sensor that counts no electrons.
        """
        rng = numbered_generator(self.seed, k, _FRAME_STREAM)
        record: dict[str, Any] = {}
        for vary in (self._image, self._lights, self._background, self._boxes):
            scene = vary(rng, scene, record)
        craft = self.vary.craft
        if craft is not None:
            record["craft"] = k // craft.every
            variation = _variation(self.target, msgspec.json.encode(craft), self.seed, record["craft"])
            drawn = varied_target(self.target, variation)
            reference = TargetRef(name=self.target.name, sha256=drawn.sha256, variation=variation)
            scene = replace(scene, target=reference)
        sample = Sample() if isinstance(scene.sample, msgspec.UnsetType) else scene.sample
        return replace(scene, sample=msgspec.structs.replace(sample, varied=VariedBy(**record)))

    def _image(self, rng: Generator, scene: SceneState, record: dict[str, Any]) -> SceneState:
        image = self.vary.image
        if image is None:
            return scene
        record["exposure"], record["noise"] = _factor(rng, image.exposure), _factor(rng, image.noise)
        sensor = _scale_noise(scene.sensor, record["noise"])
        if image.psf_sigma_px is not None:
            record["psf_sigma_px"] = float(rng.uniform(*image.psf_sigma_px))
            sensor = replace(sensor, blur_sigma_px=record["psf_sigma_px"])
        if image.pedestal_dn is not None:
            if sensor.detector is None:
                raise UserError(
                    "image.pedestal_dn varies a detector's black level, and this sensor is a noise recipe that has "
                    "none: use preset imx174 or cmv4000 in [sensor], or leave the key out"
                )
            record["pedestal_dn"] = float(np.round(rng.uniform(*image.pedestal_dn)))
            sensor = replace(sensor, detector=replace(sensor.detector, black_level_dn=record["pedestal_dn"]))
        if image.glow_share is not None:
            record["glow_share"], radius = (
                _factor(rng, image.glow_share),
                float(rng.uniform(*image.glow_radius_px)),
            )
            scene = replace(
                scene, optics=replace(scene.optics, glow_share=record["glow_share"], glow_radius_px=radius)
            )
        return replace(scene, sensor=sensor, exposure_s=scene.exposure_s * record["exposure"])

    def _background(self, rng: Generator, scene: SceneState, record: dict[str, Any]) -> SceneState:
        if self.vary.background is None:
            return scene
        names = self.vary.background.environments
        record["environment"] = names[int(rng.integers(len(names)))]
        environment = environment_preset(record["environment"])
        if record.get("earthshine") is False:
            environment = msgspec.structs.replace(environment, earthshine=False)
        if not scene.environment.sunlight:
            environment = msgspec.structs.replace(environment, sunlight=False)
        return replace(scene, environment=environment)

    def _boxes(self, rng: Generator, scene: SceneState, record: dict[str, Any]) -> SceneState:
        boxes = self.vary.boxes
        if boxes is None:
            return scene
        record["boxes"] = int(rng.integers(boxes.count[0], boxes.count[1] + 1))
        lights = tuple(_box(rng, scene, boxes) for _ in range(record["boxes"]))
        return replace(scene, lights=lights or msgspec.UNSET)

    def _lights(self, rng: Generator, scene: SceneState, record: dict[str, Any]) -> SceneState:
        lights = self.vary.lights
        if lights is None:
            return scene
        has_lamp, has_earthshine = rng.random() < lights.lamp_share, rng.random() < lights.earthshine_share
        power, half_angle = _factor(rng, lights.lamp_power_w), float(rng.uniform(*lights.lamp_half_angle_deg))
        record["lamp"], record["earthshine"] = bool(has_lamp), bool(has_earthshine)
        if has_lamp:
            scene = replace(scene, lamp=Lamp(power_w=power, half_angle_deg=half_angle))
        if not has_earthshine:
            dark = msgspec.structs.replace(scene.environment, earthshine=False)
            scene = replace(scene, environment=dark)
        return scene


def _box(rng: Generator, scene: SceneState, boxes: VaryBoxes) -> AreaLight:
    """Draw one area light near the craft."""
    origin = np.asarray(scene.t_camera_from_target_m)
    to_camera = -origin / max(float(np.linalg.norm(origin)), 1e-9)
    towards = direction_about_z(rng, 0.0, boxes.max_angle_deg)
    towards = towards @ np.stack([*light_axes(to_camera), to_camera])
    position = origin + float(rng.uniform(*boxes.distance_m)) * towards
    aim = origin + rng.uniform(0.0, boxes.aim_error_m) * uniform_direction(rng)
    return AreaLight(
        position_m=vec3(position),
        direction=vec3(aim - position),
        width_m=float(rng.uniform(*boxes.size_m)),
        height_m=float(rng.uniform(*boxes.size_m)),
        turn_deg=float(rng.uniform(0.0, 180.0)),
        radiance_w_m2_sr=_factor(rng, boxes.radiance_w_m2_sr),
        half_angle_deg=float(rng.uniform(*boxes.half_angle_deg)),
    )


def _factor(rng: Generator, bounds: tuple[float, float]) -> float:
    """Draw a factor, uniform in its logarithm."""
    return float(np.exp(rng.uniform(*np.log(bounds))))


def _scale_noise(sensor: Sensor, factor: float) -> Sensor:
    """Return the sensor with the standard deviations of its noise multiplied; a detector's shot noise is unchanged."""
    detector = sensor.detector
    if detector is not None:
        terms = ("read_noise_e", "row_noise_e", "column_noise_e", "dsnu_e")
        detector = replace(detector, **{name: getattr(detector, name) * factor for name in terms})
    return replace(
        sensor,
        speckle_variance=min(sensor.speckle_variance * factor**2, 1.0),
        gaussian_variance=min(sensor.gaussian_variance * factor**2, 1.0),
        detector=detector,
    )


@lru_cache(maxsize=4)
def _variation(target: Target, encoded: bytes, seed: int, number: int) -> CraftVariation:
    """Draw the shape and surface variation of craft ``number``."""
    craft = msgspec.json.decode(encoded, type=VaryCraft)
    rng = numbered_generator(seed, number, _CRAFT_STREAM)
    raw = rng.standard_normal((3, 3))
    stretch = (raw + raw.T) / 2
    largest_shift_m = max(float(np.linalg.norm(p.positions_m @ stretch, axis=1).max()) for p in target.parts)
    error = float(rng.uniform(*craft.model_error_mm)) * 1e-3
    rows = [tuple(float(x) for x in row) for row in stretch * (error / largest_shift_m)]
    surfaces = {
        m.name: SurfaceVariation(
            reflectance=_factor(rng, craft.reflectance), roughness=_factor(rng, craft.roughness)
        )
        for m in target.materials
    }
    return CraftVariation(
        base_sha256=target.sha256,
        stretch=(rows[0], rows[1], rows[2]),  # type: ignore[arg-type]
        error_m=error,
        surfaces=surfaces,
    )
