"""The scenario file as typed, frozen data, with units in the keys and angles in degrees."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from flyaround.simulator.camera.lens.files import CameraFile
from flyaround.simulator.camera.sections import OpticsSection
from flyaround.simulator.scenario.document import Document, Output, SensorSection
from flyaround.simulator.scenario.faults import Faults
from flyaround.simulator.scene.environments import EnvironmentSection
from flyaround.simulator.scene.illumination.area_light import MAX_LIGHTS, AreaLight
from flyaround.simulator.scene.illumination.lamp import Lamp
from flyaround.simulator.scene.second_camera import SecondCamera
from flyaround.simulator.world.attitude.target_attitude import Attitude
from flyaround.simulator.world.flight.recording import Replay
from flyaround.simulator.world.guidance.command_script import CommandScript
from flyaround.simulator.world.guidance.free_flight import (
    FollowedChaser,
    FreeDrift,
    NaturalCircumnavigation,
    RangeKeeping,
    SafeEllipse,
)
from flyaround.simulator.world.guidance.paths import (
    ForcedFlyaround,
    Glideslope,
    Hold,
    RbarApproach,
    VbarApproach,
    Waypoints,
)
from flyaround.simulator.world.guidance.thrusters import CHASER_MASS_KG, Thrusters
from flyaround.simulator.world.orbit.burns import Burn
from flyaround.simulator.world.orbit.forces import Forces
from flyaround.simulator.world.orbit.initial_orbit import ElementsOrbit, OemOrbit, StateOrbit, TleOrbit

AnyChaser = (
    Replay
    | Hold
    | FreeDrift
    | NaturalCircumnavigation
    | SafeEllipse
    | VbarApproach
    | RbarApproach
    | ForcedFlyaround
    | Waypoints
    | Glideslope
    | RangeKeeping
    | CommandScript
    | FollowedChaser
)


class Scenario(Document, frozen=True, kw_only=True):
    """A scenario file, read and checked.

    The loader replaces references to camera files, orbit files, attitude files and TLEs by their contents, so that a
    loaded scenario is self-contained.
    """

    schema: Literal["flyaround.scenario"] = "flyaround.scenario"
    version: Literal[1] = 1
    name: str = ""
    title: str = ""
    description: str = ""
    epoch_utc: str
    duration_s: Annotated[float, Meta(gt=0, le=604_800)]
    target: str = "tango"
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)] = 0
    orbit: ElementsOrbit | StateOrbit | TleOrbit | OemOrbit
    forces: Forces = Forces()
    burns: Annotated[list[Burn], Meta(max_length=1000)] = msgspec.field(default_factory=list)
    attitude: Attitude = Attitude()
    chaser: AnyChaser
    camera: str | CameraFile = "speed"
    sensor: SensorSection = SensorSection()
    optics: OpticsSection = OpticsSection()
    environment: EnvironmentSection = EnvironmentSection()
    lamp: Lamp | None = None
    second_camera: SecondCamera | None = None
    lights: Annotated[list[AreaLight], Meta(max_length=MAX_LIGHTS)] = msgspec.field(default_factory=list)
    output: Output = Output()
    faults: Faults | None = None

    @property
    def chaser_thrusters(self) -> Thrusters:
        """The chaser's thrusters, or default ones of its mass for manual control."""
        return self.chaser.acting_thrusters or Thrusters(mass_kg=self.forces.chaser.mass_kg or CHASER_MASS_KG)
