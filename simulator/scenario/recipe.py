"""The recipe file as typed, frozen data: distributions and their bounds, with units in the keys."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from flyaround.simulator.camera.lens.files import CameraFile
from flyaround.simulator.camera.sections import OpticsSection
from flyaround.simulator.runtime.sections import Degrees, Interval, Metres, Range, Section
from flyaround.simulator.scenario.document import Document, Output, SensorSection
from flyaround.simulator.scenario.vary import Vary
from flyaround.simulator.scene.environments import EnvironmentName, EnvironmentSection
from flyaround.simulator.scene.illumination.area_light import MAX_LIGHTS, AreaLight
from flyaround.simulator.scene.illumination.lamp import Lamp
from flyaround.simulator.scene.second_camera import SecondCamera

Share = Annotated[float, Meta(ge=0, le=1)]
Angle = Annotated[float, Meta(ge=0, le=180)]
Count = Annotated[int, Meta(ge=1, le=10_000_000)]
AltitudeKm = Annotated[float, Meta(ge=20, le=100_000)]


class UniformRange(Section, frozen=True, kw_only=True, tag_field="kind", tag="uniform"):
    """Depth of the model's origin along the camera's z, uniform."""

    near_m: Range
    far_m: Range


class ScaledRange(Section, frozen=True, kw_only=True, tag_field="kind", tag="scaled"):
    """Uniform depth, scaled so that a target appears as large as Tango does at ``near_m`` and ``far_m``."""

    near_m: Range = 3.0
    far_m: Range = 18.0


class NormalRange(Section, frozen=True, kw_only=True, tag_field="kind", tag="normal"):
    """Normal about ``mean_m``, truncated to ``near_m`` to ``far_m``."""

    mean_m: Metres
    sigma_m: Range
    near_m: Range
    far_m: Range


class InverseRange(Section, frozen=True, kw_only=True, tag_field="kind", tag="inverse"):
    """Uniform in the inverse of the depth, so that every size in the image is equally frequent."""

    near_m: Range
    far_m: Range


class UniformAttitude(Section, frozen=True, kw_only=True, tag_field="kind", tag="uniform"):
    """Uniform on SO(3)."""


class EulerAttitude(Section, frozen=True, kw_only=True, tag_field="kind", tag="euler"):
    """Three Euler angles, each uniform, as in the data-set paper; not uniform on SO(3)."""

    from_deg: Degrees = -360.0
    to_deg: Degrees = 360.0


class FacingAttitude(Section, frozen=True, kw_only=True, tag_field="kind", tag="facing"):
    """Attitudes of a flat board: its z axis points to the camera within an angle.

    The board may be anywhere in the image, so this section defines range and placement too.
    """

    within_deg: Annotated[float, Meta(gt=0, lt=80)] = 45.0


class InViewPlacement(Section, frozen=True, kw_only=True, tag_field="kind", tag="in_view"):
    """Uniform in the image with the bounding sphere inside; on the axis if the sphere is larger than the image."""


class BoundsPlacement(Section, frozen=True, kw_only=True, tag_field="kind", tag="bounds"):
    """x and y uniform within bounds proportional to the depth: ``x_m`` and ``y_m`` at depth ``at_m``."""

    x_m: Annotated[float, Meta(ge=0, le=1e5)]
    y_m: Annotated[float, Meta(ge=0, le=1e5)]
    at_m: Range


class NormalPlacement(Section, frozen=True, kw_only=True, tag_field="kind", tag="normal"):
    """Normal about the image's centre, in units of half its width and height, truncated to the image."""

    sigma: Annotated[float, Meta(ge=0, le=2)] = 0.3


class PoseList(Section, frozen=True, kw_only=True, tag_field="kind", tag="list"):
    """Poses of a CSV file next to the recipe, in order: the format of `render --poses` or `recipes --samples`."""

    file: str


class AboutTrajectory(Section, frozen=True, kw_only=True, tag_field="kind", tag="trajectory"):
    """Poses, light and sky at times of a scenario's flight, optionally with deviations.

    ``moments`` are evenly spaced over the flight, or random. ``scenario`` is a built-in name or a file.
    """

    scenario: str
    moments: Literal["even", "random"] = "random"
    position_sigma_m: Annotated[float, Meta(ge=0, le=1e4)] = 0.0
    attitude_sigma_deg: Annotated[float, Meta(ge=0, le=180)] = 0.0


class Sequences(Section, frozen=True, kw_only=True, tag_field="kind", tag="sequences"):
    """Flights of a scenario with random initial conditions: ``frames`` images each, ``every_s`` apart.

    A flight starts at a random position in the orbit, at ``range_m`` from the target. The target's initial attitude is
    uniform on SO(3), and it rotates about a random axis at a rate within ``rate_deg_s``. With ``sunlit``, the target is
    sunlit at start and end.
    """

    scenario: str
    frames: Annotated[int, Meta(ge=2, le=100_000)]
    every_s: Annotated[float, Meta(gt=0, le=3600)]
    range_m: Interval[Range]
    rate_deg_s: Interval[Annotated[float, Meta(ge=0, le=90)]]
    sunlit: bool = True


class Sky(Section, frozen=True, kw_only=True):
    """Distribution of the directions of Sun and nadir, camera axes; a matching date and position are then drawn.

    ``max_phase_deg``: largest angle at the target between Sun and camera, uniform in solid angle.
    ``nadir_off_boresight_deg``: angle between boresight and nadir, uniform in solid angle; 64 degrees puts the Earth's
    limb on the boresight at 700 km. ``night_share``: share of samples with dark ground below. ``share``: weight among
    several skies.
    """

    share: Annotated[float, Meta(gt=0, le=1)] = 1.0
    body: str = "earth"
    altitude_km: AltitudeKm = 700.0
    nadir_off_boresight_deg: Interval[Angle]
    max_phase_deg: Angle = 120.0
    night_share: Share = 0.1
    least_sun_elevation_sine: Annotated[float, Meta(ge=-1, le=0.99)] | None = None


class Background(Section, frozen=True, kw_only=True):
    """A library of ``views`` of the sky, from random positions above a body with random camera attitudes.

    The position is sunlit and the phase angle at most ``max_phase_deg``, so that a craft there is lit. ``least_share``
    is the smallest share of the image that shows the body's day side; views with less are rejected.
    """

    body: str = "earth"
    views: Count = 3000
    seed: Annotated[int, Meta(ge=0, le=2**53 - 1)] = 0
    altitude_km: AltitudeKm = 400.0
    max_phase_deg: Annotated[float, Meta(ge=10, le=180)] = 120.0
    least_share: Share = 0.0


class Constraints(Section, frozen=True, kw_only=True):
    """Conditions on a pose, for rejection sampling. Rejected poses are counted.

    ``clearance_m``: smallest distance from the camera to the mesh. ``origin_in_image``: the model's origin must be in
    the image. ``inside``: smallest share of the projected mesh's bounding box in the image. ``most_draws``: number of
    draws before an error.
    """

    clearance_m: Annotated[float, Meta(gt=0, le=1e4)] | None = None
    origin_in_image: bool = False
    inside: Annotated[float, Meta(gt=0, le=1)] | None = None
    most_draws: Annotated[int, Meta(ge=1, le=100_000)] = 1000


class Pairs(Section, frozen=True, kw_only=True):
    """Every sample is drawn once in each of these environments."""

    environments: Annotated[list[EnvironmentName], Meta(min_length=2, max_length=8)]


AnyRange = UniformRange | ScaledRange | NormalRange | InverseRange
AnyAttitude = UniformAttitude | EulerAttitude | FacingAttitude
AnyPlacement = InViewPlacement | BoundsPlacement | NormalPlacement
AnyPoses = PoseList | AboutTrajectory | Sequences


class Recipe(Document, frozen=True, kw_only=True):
    """A recipe file, read and checked.

    ``base`` names a built-in recipe or a file next to this one; its sections are the defaults of this file. A recipe
    with ``members`` is a group of recipes, each of which becomes a data set. ``frames`` is the default number of
    frames. ``poses`` replace range, attitude and placement; poses of flights also replace the sky.
    """

    schema: Literal["flyaround.recipe"] = "flyaround.recipe"
    version: Literal[1] = 1
    name: str = ""
    title: str = ""
    description: str = ""
    base: str = ""
    members: Annotated[list[str], Meta(max_length=100)] = msgspec.field(default_factory=list)
    target: str = "tango"
    frames: Count = 20
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)] = 0
    split: Annotated[list[Count], Meta(max_length=10)] = msgspec.field(default_factory=list)
    range: AnyRange = ScaledRange()
    attitude: AnyAttitude = UniformAttitude()
    placement: AnyPlacement = InViewPlacement()
    poses: AnyPoses | None = None
    sky: Annotated[list[Sky], Meta(min_length=1, max_length=100)] = msgspec.field(
        default_factory=lambda: [Sky(nadir_off_boresight_deg=(0.0, 66.0))]
    )
    background: Background | None = None
    constraints: Constraints = Constraints()
    pairs: Pairs | None = None
    vary: Vary | None = None
    camera: str | CameraFile = "speed"
    sensor: SensorSection = SensorSection()
    optics: OpticsSection = OpticsSection()
    environment: EnvironmentSection = EnvironmentSection()
    lamp: Lamp | None = None
    second_camera: SecondCamera | None = None
    lights: Annotated[list[AreaLight], Meta(max_length=MAX_LIGHTS)] = msgspec.field(default_factory=list)
    output: Output = Output()
