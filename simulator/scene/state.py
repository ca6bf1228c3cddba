"""SceneState: all inputs of one image, frozen at mid-exposure, float64, no GL."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from msgspec import UNSET, UnsetType

from flyaround.simulator.camera.detector.optics import Optics
from flyaround.simulator.camera.detector.sensor import Sensor
from flyaround.simulator.camera.detector.shutter import Shutter
from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.runtime.arrays import Quat, Vec3, vec3
from flyaround.simulator.scene.environments import ENVIRONMENTS, Environment
from flyaround.simulator.scene.illumination.area_light import AreaLight
from flyaround.simulator.scene.illumination.bands import Bands
from flyaround.simulator.scene.illumination.lamp import Lamp
from flyaround.simulator.scene.sample import Sample
from flyaround.simulator.targets.varied import CraftVariation, target_as_drawn
from flyaround.simulator.world.ephemeris.body import BodyState, BodyStates
from flyaround.simulator.world.frames.pose import Pose
from flyaround.simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from flyaround.simulator.targets.model import Target

Quality = Literal["draft", "default", "high"]
_PERFECT_LENS = Optics()


@dataclass(frozen=True, kw_only=True)
class TargetRef:
    """Name and SHA-256 of the drawn target model, and its variation, if any."""

    name: str
    sha256: str
    variation: CraftVariation | UnsetType = UNSET

    def drawn(self, base: Target | None = None) -> Target:
        """Return the drawn craft.

        Parameters
        ----------
        base : Target, optional
            Model of that name, or the craft itself; by default it is loaded by name.

        Returns
        -------
        Target
            Target with the variation, or the given one.

        Raises
        ------
        UserError
            If another model now has the name.
        """
        if base is not None and base.sha256 == self.sha256:
            return base
        variation = None if isinstance(self.variation, UnsetType) else self.variation
        return target_as_drawn(self.name, self.sha256, variation, base)


@dataclass(frozen=True, kw_only=True)
class SceneState(BodyStates):
    """A snapshot of the world at mid-exposure.

    Frames: ``eci`` is GCRS, ``itrs`` Earth-fixed, ``camera`` x right y down z forward, ``target`` the
    model's own frame. Quaternions are Hamilton, scalar first.

    Parameters
    ----------
    epoch_utc : str
        Mid-exposure, ISO 8601 with a trailing Z.
    t_s : float
        Seconds since the scenario's start.
    frame_index : int
        Number of the frame; with ``seed`` the key of its random numbers.
    seed : int
        Seed of the random numbers.
    camera : Camera
        Camera that takes the image.
    sensor : Sensor
        Detector: noise, full well, bits and transfer function.
    exposure_s : float
        Integration time [s].
    optics : Optics, optional
        Effects of the lens other than distortion.
    shutter : Shutter, optional
        Exposure times of the rows.
    quality : Quality, optional
        Preset of the renderer.
    bands : Bands, optional
        ``mono`` (panchromatic) or ``rgb``.
    environment : Environment, optional
        Layers of the world that are drawn.
    target : TargetRef
        Name and hash of the target's model.
    q_camera_from_target_wxyz : array
        Rotation from the model frame to the camera frame.
    t_camera_from_target_m : array
        Origin of the model frame, camera frame [m].
    omega_target_rad_s : array
        Angular velocity of the target relative to ECI, target frame [rad s-1].
    v_target_camera_m_s : array
        Velocity of the target's origin in the (rotating) camera frame [m s-1].
    r_camera_eci_m : array
        Position of the camera, GCRS [m].
    v_camera_eci_m_s : array
        Velocity of the camera, GCRS [m s-1].
    q_camera_from_eci_wxyz : array
        Rotation from GCRS to the camera frame.
    omega_camera_rad_s : array
        Angular velocity of the camera, camera frame [rad s-1].
    r_target_eci_m : array
        Position of the target's centre of mass, GCRS [m].
    v_target_eci_m_s : array
        Velocity of the target's centre of mass, GCRS [m s-1].
    r_sun_eci_m : array
        Apparent geocentric position of the Sun [m].
    bodies : tuple of BodyState
        Earth, Moon and, if different, the central body. The position of the central body is geometric, not apparent, so
        that its difference from ``r_camera_eci_m`` is the camera's position relative to the ground.
    sun_visible_fraction : float
        Share of the Sun's disc visible from the target past the bodies, 0..1.
    central_body : str, optional
        Name of the body that the target orbits.
    lamp : Lamp, optional
        Lamp on the chaser, if lit.
    lights : tuple of AreaLight, optional
        Area lights, if any.
    sample : Sample, optional
        Further random draws of a recipe, if any.
    """

    epoch_utc: str
    t_s: float
    frame_index: int
    seed: int
    camera: Camera
    sensor: Sensor
    exposure_s: float
    optics: Optics = _PERFECT_LENS
    shutter: Shutter = field(default_factory=Shutter)
    quality: Quality = "default"
    bands: Bands = "mono"
    environment: Environment = ENVIRONMENTS["full"]
    target: TargetRef
    q_camera_from_target_wxyz: Quat
    t_camera_from_target_m: Vec3
    omega_target_rad_s: Vec3
    v_target_camera_m_s: Vec3
    r_camera_eci_m: Vec3
    v_camera_eci_m_s: Vec3
    q_camera_from_eci_wxyz: Quat
    omega_camera_rad_s: Vec3
    r_target_eci_m: Vec3
    v_target_eci_m_s: Vec3
    r_sun_eci_m: Vec3
    bodies: tuple[BodyState, ...]
    sun_visible_fraction: float
    central_body: str = "earth"
    lamp: Lamp | None = None
    lights: tuple[AreaLight, ...] | UnsetType = UNSET
    sample: Sample | UnsetType = UNSET

    def with_body(self, name: str, **changes: Vec3 | Quat) -> SceneState:
        """Return the scene with changed fields of one body's `BodyState`.

        Returns
        -------
        SceneState
            Copy of the scene.
        """
        new_state = replace(self.body(name), **changes)  # type: ignore[arg-type]
        return replace(self, bodies=tuple(new_state if b.name == name else b for b in self.bodies))

    @property
    def globe(self) -> BodyState:
        """State of the ray-cast body: the central one, or the Earth for orbits about the Moon."""
        central = self.central
        return self.body("earth") if central.body.surface == "moon" else central

    @property
    def area_lights(self) -> tuple[AreaLight, ...]:
        """The area lights, if any."""
        return () if isinstance(self.lights, UnsetType) else self.lights

    @property
    def has_lamps(self) -> bool:
        """True if anything other than Sun, Earth and Moon lights the target."""
        return self.lamp is not None or bool(self.area_lights)

    @property
    def sunlit_fraction(self) -> float:
        """Share of sunlight on the target, 0..1: ``sun_visible_fraction`` if sunlight is on."""
        return self.sun_visible_fraction if self.environment.sunlight else 0.0

    @property
    def camera_from_target(self) -> Pose:
        """Pose of the target in the camera frame: the label."""
        return Pose("camera", "target", self.q_camera_from_target_wxyz, self.t_camera_from_target_m)

    @property
    def earth_direction_camera(self) -> Vec3:
        """Unit vector from the target to the Earth's centre, camera frame."""
        d = matrix_from_quat(self.q_camera_from_eci_wxyz) @ np.asarray(self.r_target_eci_m)
        return vec3(-d / np.linalg.norm(d))

    @property
    def sun_direction_camera(self) -> Vec3:
        """Unit vector from the target to the apparent Sun, camera frame."""
        to_sun = np.asarray(self.r_sun_eci_m) - np.asarray(self.r_target_eci_m)
        d = matrix_from_quat(self.q_camera_from_eci_wxyz) @ to_sun
        return vec3(d / np.linalg.norm(d))
