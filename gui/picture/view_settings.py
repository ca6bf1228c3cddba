"""How the operator wants the view drawn: exposure, layers, bands, detail; applied to a scene."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

from simulator.scene.environments import Environment
from simulator.scene.illumination.bands import Bands
from simulator.scene.state import Quality

if TYPE_CHECKING:
    from simulator.camera.lens.camera_model import Camera
    from simulator.scene.state import SceneState

Detail = Literal["auto", "full", "half", "quarter"]
DETAILS: tuple[Detail, ...] = ("auto", "full", "half", "quarter")
LAYERS: tuple[tuple[str, str], ...] = (
    ("earth", "Earth"),
    ("clouds", "Clouds"),
    ("ocean_glint", "Ocean glint"),
    ("sea_ice", "Sea ice"),
    ("night_lights", "Night lights"),
    ("atmosphere", "Atmosphere"),
    ("stars", "Stars"),
    ("sun", "Sun"),
    ("moon", "Moon"),
    ("earthshine", "Earthshine"),
)
OVERLAYS: tuple[tuple[str, str], ...] = (
    ("keypoints", "Keypoints"),
    ("names", "Names"),
    ("box", "Box"),
    ("axes", "Target axes"),
    ("wireframe", "Wireframe"),
    ("crosshair", "Crosshair"),
    ("hud", "Figures"),
    ("docking", "Docking"),
    ("times", "Pass times"),
)


@dataclass
class ViewSettings:
    """The operator's choices.

    Parameters
    ----------
    exposure_stops : added to the scenario's exposure, in powers of two.
    bands, environment : instead of the scenario's.
    noise : whether the sensor's noise is added.
    detail : resolution while time runs; when paused the picture is always whole.
    """

    bands: Bands
    environment: Environment
    exposure_stops: float = 0.0
    noise: bool = True
    detail: Detail = "auto"


@dataclass
class Overlays:
    """What is written over the view."""

    keypoints: bool = False
    names: bool = False
    box: bool = False
    axes: bool = False
    wireframe: bool = False
    crosshair: bool = True
    hud: bool = True
    docking: bool = False
    times: bool = False


@dataclass
class Options:
    """Everything that the operator can switch and that is not part of the flight."""

    settings: ViewSettings
    overlays: Overlays = field(default_factory=Overlays)
    panel: bool = True


def apply_view_settings(
    scene: SceneState, settings: ViewSettings, *, divisor: int = 1, quality: Quality | None = None
) -> SceneState:
    """The scene with the operator's choices.

    Parameters
    ----------
    divisor : pixels of the camera per pixel drawn, each way.
    quality : instead of the scenario's.
    """
    sensor = scene.sensor
    if not settings.noise:
        sensor = replace(sensor, speckle_variance=0.0, gaussian_variance=0.0)
    if divisor != 1:
        sensor = replace(sensor, blur_sigma_px=sensor.blur_sigma_px / divisor)
    return replace(
        scene,
        camera=reduced_camera(scene.camera, divisor),
        sensor=sensor,
        exposure_s=scene.exposure_s * 2.0**settings.exposure_stops,
        bands=settings.bands,
        environment=settings.environment,
        quality=scene.quality if quality is None else quality,
    )


def reduced_camera(camera: Camera, divisor: int) -> Camera:
    """The same lens on ``divisor`` times fewer pixels each way.

    A pixel's index is its centre, so a coarse pixel's centre lies half a coarse pixel from the image's edge:
    ``c' = (c + 1/2) / divisor - 1/2``.
    """
    if divisor == 1:
        return camera
    return replace(
        camera,
        width_px=max(camera.width_px // divisor, 1),
        height_px=max(camera.height_px // divisor, 1),
        fx_px=camera.fx_px / divisor,
        fy_px=camera.fy_px / divisor,
        cx_px=(camera.cx_px + 0.5) / divisor - 0.5,
        cy_px=(camera.cy_px + 0.5) / divisor - 0.5,
    )
