"""The operator's settings of the view: exposure, layers, bands, detail; applied to a scene."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal

import msgspec

from flyaround.gui.picture.light_settings import Lights, lit, scenario_with
from flyaround.gui.picture.orbit_camera import OrbitCamera
from flyaround.gui.picture.relative_map import MapLook
from flyaround.gui.texts import texts
from flyaround.simulator.camera.detector.sensor import noiseless
from flyaround.simulator.camera.lens.camera_model import reduced_camera
from flyaround.simulator.camera.lens.files import CameraFile
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.scene.illumination.bands import Bands
from flyaround.simulator.scene.state import Quality

if TYPE_CHECKING:
    from flyaround.simulator.camera.detector.sensor import Sensor
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.piloting.piloted_craft import PilotChoices
    from flyaround.simulator.scenario.scenario import Scenario
    from flyaround.simulator.scene.state import SceneState

Detail = Literal["auto", "full", "half", "quarter"]
DETAILS: tuple[Detail, ...] = ("auto", "full", "half", "quarter")
LAYERS: dict[str, str] = texts("layers")
OVERLAYS: dict[str, str] = texts("overlays")


@dataclass
class ViewSettings:
    """The operator's settings.

    Parameters
    ----------
    bands : Bands
        Bands instead of the scenario's.
    environment : Environment
        Layers of the world instead of the scenario's.
    exposure_stops : float, optional
        Powers of two on the scenario's exposure.
    noise : bool, optional
        True to add the sensor's noise.
    detail : Detail, optional
        Resolution while time runs; paused pictures are drawn at full size.
    camera : Camera, optional
        Replaces the scenario's.
    sensor_changes : dict of str to float, optional
        Changed fields of the sensor or its detector, by name.
    lights : tuple of SwitchedLight, optional
        Replace the scenario's.
    """

    bands: Bands
    environment: Environment
    exposure_stops: float = 0.0
    noise: bool = True
    detail: Detail = "auto"
    camera: Camera | None = None
    sensor_changes: dict[str, float] = field(default_factory=dict)
    lights: Lights | None = None


@dataclass
class Overlays:
    """Overlays of the view; ``raw`` shows raw numbers instead of a photograph."""

    keypoints: bool = False
    names: bool = False
    box: bool = False
    axes: bool = False
    wireframe: bool = False
    estimate: bool = True
    crosshair: bool = True
    hud: bool = True
    docking: bool = False
    times: bool = False
    raw: bool = False


@dataclass
class Options:
    """All settings of the operator, with the pilot's choices of the present flight."""

    settings: ViewSettings
    overlays: Overlays = field(default_factory=Overlays)
    panel: bool = True
    map: MapLook = field(default_factory=MapLook)
    orbit: OrbitCamera = field(default_factory=OrbitCamera)
    flight: PilotChoices | None = None


def apply_view_settings(
    scene: SceneState, settings: ViewSettings, *, divisor: int = 1, quality: Quality | None = None
) -> SceneState:
    """Return the scene with the operator's settings applied.

    Parameters
    ----------
    scene : SceneState
        Scene of the flight.
    settings : ViewSettings
        Settings of the view.
    divisor : int, optional
        Camera pixels per drawn pixel, each way.
    quality : Quality, optional
        Replaces the scenario's.
    """
    sensor = changed_sensor(scene.sensor, settings.sensor_changes)
    if not settings.noise:
        sensor = noiseless(sensor)
    if divisor != 1:
        sensor = replace(sensor, blur_sigma_px=sensor.blur_sigma_px / divisor)
    return replace(
        lit(scene, settings.lights),
        camera=reduced_camera(settings.camera or scene.camera, divisor),
        sensor=sensor,
        exposure_s=scene.exposure_s * 2.0**settings.exposure_stops,
        bands=settings.bands,
        environment=settings.environment,
        quality=scene.quality if quality is None else quality,
    )


def scenario_as_seen(scenario: Scenario, settings: ViewSettings) -> Scenario:
    """Return the scenario with the operator's camera, exposure, noise recipe, bands and lights.

    The switch of the noise, a detector's parameters and the layers of the world remain the scenario's.
    """
    changes = {n: v for n, v in settings.sensor_changes.items() if hasattr(scenario.sensor, n)}
    stops, camera = settings.exposure_stops, scenario.camera
    sensor = msgspec.structs.replace(
        scenario.sensor, exposure_s=scenario.sensor.exposure_s * 2.0**stops, **changes
    )
    if settings.camera is not None:
        keys = {n: v for n, v in asdict(settings.camera).items() if v is not msgspec.UNSET}
        camera = msgspec.convert(keys, CameraFile)
        # a region and its binning belong to the scenario's camera
        sensor = msgspec.structs.replace(sensor, roi_px=None, binning=1)
    return msgspec.structs.replace(
        scenario if settings.lights is None else scenario_with(scenario, settings.lights),
        camera=camera,
        sensor=sensor,
        output=msgspec.structs.replace(scenario.output, bands=settings.bands),
    )


def changed_sensor(sensor: Sensor, changes: dict[str, float]) -> Sensor:
    """Return a sensor with some of its numbers changed; names that it lacks are ignored."""
    detector = sensor.detector
    of_detector: dict[str, Any] = {n: v for n, v in changes.items() if hasattr(detector, n)}
    own: dict[str, Any] = {n: v for n, v in changes.items() if hasattr(sensor, n) and n not in of_detector}
    own = {name: type(getattr(sensor, name))(value) for name, value in own.items()}
    return replace(sensor, detector=detector and replace(detector, **of_detector), **own)


def exposure_text(seconds: float) -> str:
    """Return an exposure in the unit that gives two or three digits."""
    unit, factor = ("µs", 1e6) if seconds < 1e-3 else ("ms", 1e3) if seconds < 1.0 else ("s", 1.0)
    digits = max(0, 2 - math.floor(math.log10(seconds * factor)))
    return f"{seconds * factor:.{digits}f} {unit}"
