"""SceneRecord: a scene as stored in truth records, with Earth and Moon under their own keys."""

from __future__ import annotations

from dataclasses import fields
from typing import Annotated, Any

import msgspec
from msgspec import UNSET, Meta, UnsetType

from flyaround.simulator.camera.detector.optics import Optics
from flyaround.simulator.camera.detector.sensor import Sensor
from flyaround.simulator.camera.detector.shutter import Shutter
from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.runtime.arrays import Quat, Vec3
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.scene.illumination.area_light import AreaLight
from flyaround.simulator.scene.illumination.bands import Bands
from flyaround.simulator.scene.illumination.lamp import Lamp
from flyaround.simulator.scene.sample import Sample
from flyaround.simulator.scene.state import Quality, SceneState, TargetRef
from flyaround.simulator.world.ephemeris.body import BodyState, earth_and_moon


class RecordedEnvironment(Environment, frozen=True, kw_only=True):
    """An environment as recorded. Older records lack aerosol and airglow, and get the values they were drawn with."""

    airglow: bool = False
    aerosol_optical_depth: Annotated[float, Meta(ge=0, le=1)] = 0.0053


class SceneRecord(msgspec.Struct, frozen=True, kw_only=True):
    """The recorded form of a `SceneState`: fields for Earth and Moon replace its ``bodies``.

    The other fields are those of `SceneState`.

    Attributes
    ----------
    r_moon_eci_m : tuple of float
        Apparent geocentric position [m]; in orbit about the Moon the geometric one.
    q_itrs_from_eci_wxyz : tuple of float
        Orientation of the Earth (ITRS).
    q_moon_from_eci_wxyz : tuple of float
        Orientation of the Moon (mean Earth / polar axis frame: x to longitude 0, z along the axis).
    bodies : tuple of BodyState
        Other bodies, if any.
    """

    epoch_utc: str
    t_s: float
    frame_index: int
    seed: int
    camera: Camera
    sensor: Sensor
    exposure_s: float
    optics: Optics = msgspec.field(default_factory=Optics)
    shutter: Shutter = msgspec.field(default_factory=Shutter)
    quality: Quality = "default"
    bands: Bands = "mono"
    environment: RecordedEnvironment = RecordedEnvironment()
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
    r_moon_eci_m: Vec3
    q_itrs_from_eci_wxyz: Quat
    sun_visible_fraction: float
    q_moon_from_eci_wxyz: Quat = (1.0, 0.0, 0.0, 0.0)
    central_body: str = "earth"
    lamp: Lamp | None = None
    lights: tuple[AreaLight, ...] | UnsetType = UNSET
    sample: Sample | UnsetType = UNSET
    bodies: tuple[BodyState, ...] | UnsetType = UNSET

    @staticmethod
    def from_scene(scene: SceneState) -> SceneRecord:
        """Return the record of a scene.

        Returns
        -------
        SceneRecord
            Record that `scene` reads back. Bodies other than the Earth and the Moon are in ``bodies``, UNSET without
            any.
        """
        earth, moon, *other_bodies = scene.bodies
        environment = RecordedEnvironment(**msgspec.structs.asdict(scene.environment))
        return SceneRecord(
            **_common(scene) | {"environment": environment},
            r_moon_eci_m=moon.r_eci_m,
            q_itrs_from_eci_wxyz=earth.q_fixed_from_eci_wxyz,
            q_moon_from_eci_wxyz=moon.q_fixed_from_eci_wxyz,
            bodies=tuple(other_bodies) or UNSET,
        )

    def scene(self) -> SceneState:
        """Return the scene that was recorded.

        Returns
        -------
        SceneState
            Scene whose bodies are the Earth, the Moon, and those of ``bodies`` in that order.
        """
        extra_bodies = () if isinstance(self.bodies, UnsetType) else self.bodies
        environment = Environment(**msgspec.structs.asdict(self.environment))
        return SceneState(
            **_common(self) | {"environment": environment},
            bodies=(
                *earth_and_moon(self.r_moon_eci_m, self.q_itrs_from_eci_wxyz, self.q_moon_from_eci_wxyz),
                *extra_bodies,
            ),
        )


def _common(scene: SceneRecord | SceneState) -> dict[str, Any]:
    """Return the fields that a scene and its record have in common."""
    return {f.name: getattr(scene, f.name) for f in fields(SceneState) if f.name != "bodies"}
