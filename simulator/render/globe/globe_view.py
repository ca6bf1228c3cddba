"""View of the globe: the camera in stretched body-fixed axes, and the part of the image that shows the globe."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.render.frame_graph import Resource
from flyaround.simulator.render.gl.uniform_block import vec4_of_bands
from flyaround.simulator.render.projection import PixelRect, directions
from flyaround.simulator.scene.illumination.atmosphere import SUN_ANGULAR_RADIUS_RAD

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.render.view import View
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.illumination.atmosphere import Atmosphere

# Distance of the nadir from the image [rad], and cosine of the steepest ray, within which the whole range of azimuths
# is taken, because near the nadir the azimuth changes fast.
_NEAR_NADIR_RAD, _STEEP_COSINE = 0.1, 0.5
# Margins of ground and sky in units of the air's thickness, because the limb may lie between the rays of the grid.
_GROUND_MARGIN, _SKY_MARGIN = 0.05, 0.3
# Altitude in thicknesses to which a camera inside the air is moved: its tables hold no rays that start inside.
_OUTSIDE_AIR = 1.01
# Margin over the apparent radius of a distant globe, for a lens that stretches it, and least cosine of its direction.
_STRETCH, _MIN_COSINE = 1.5, 0.2
_GRID = 33  # sampled rays per side of the image, to find what is in view


@dataclass(frozen=True, eq=False)
class GlobeView:
    """The camera relative to the globe, and the parts of the globe in view.

    Vectors are in stretched space: body-fixed axes in equatorial radii, with the polar axis stretched by a / b, so that
    the ellipsoid is a unit sphere.

    Parameters
    ----------
    earth_from_camera : (3, 3) array
        Matrix that maps directions from the camera frame (not a rotation).
    camera : (3,) array
        Position of the camera.
    sun : (3,) array
        Unit vector to the Sun.
    top2 : float
        Squared radius of the top of the air.
    rect : PixelRect or None
        Pixels that the globe or its air may touch; ``None`` if there are none.
    ground_rows : tuple of float or None
        Range in view of the row coordinate 0..1 of the air table's part for ground; None if no ground is in view.
    sky_rows : tuple of float or None
        The same for the part for sky.
    azimuth : tuple of float
        Range in view of the table's column coordinate -1..1.
    """

    earth_from_camera: FloatArray
    camera: FloatArray
    sun: FloatArray
    top2: float
    rect: PixelRect | None
    ground_rows: tuple[float, float] | None
    sky_rows: tuple[float, float] | None
    azimuth: tuple[float, float]

    @property
    def fills_image(self) -> bool:
        """True if the globe fills the image, so that nothing behind it is visible."""
        return self.rect is not None and self.sky_rows is None

    @property
    def sun_cosine(self) -> float:
        """Cosine of the Sun's angle from the camera's zenith."""
        return float(self.camera @ self.sun / np.linalg.norm(self.camera))


GLOBE: Resource[GlobeView] = Resource("globe")
"""The globe in the image; it hides everything behind it."""


def globe_view(view: View, camera: Camera, air: Atmosphere | None) -> GlobeView:
    """Find the globe in the image.

    Parameters
    ----------
    view : View
        Scene in camera coordinates.
    camera : Camera
        Camera of the scene.
    air : Atmosphere or None
        Atmosphere, whose thickness widens the region; ``None`` without atmosphere.
    """
    equator_m = view.globe.radius_m
    stretch = np.array([1.0, 1.0, equator_m / view.globe.polar_radius_m])
    globe_from_camera = stretch[:, None] * view.R_camera_from_globe.T
    camera_position = stretch * view.r_camera_globe_m / equator_m
    sun = stretch * view.sun_globe
    sun = sun / np.linalg.norm(sun)
    # without air, keep a margin for the half pixel at the limb
    thickness = air.thickness_m / equator_m if air is not None else 2e-3
    top2 = (1 + thickness) ** 2
    radius = float(np.linalg.norm(camera_position))
    camera_position = camera_position * max(1.0, (1 + _OUTSIDE_AIR * thickness) / radius)
    rays = directions(
        camera, _grid_positions(camera.width_px), _grid_positions(camera.height_px), globe_from_camera
    )
    along_camera = rays @ camera_position
    perigee2 = camera_position @ camera_position - along_camera**2
    in_view = (along_camera < 0) & (perigee2 < top2)
    rect = _globe_rect(in_view, perigee2, along_camera, view, camera, top2)
    if rect is None:
        return GlobeView(globe_from_camera, camera_position, sun, top2, None, None, None, (-1, 1))
    zenith = camera_position / np.linalg.norm(camera_position)
    mu_sun = float(zenith @ sun)
    cosine = rays @ zenith
    horizontal = np.sqrt(np.maximum((1 - cosine**2) * (1 - mu_sun**2), 1e-12))
    azimuth = np.minimum(np.maximum((rays @ sun - cosine * mu_sun) / horizontal, -1), 1)
    boresight = globe_from_camera[:, 2] / np.linalg.norm(globe_from_camera[:, 2])
    half_angle = math.acos(_clip_cosine((rays @ boresight).min()))
    is_near_nadir = math.acos(_clip_cosine(-zenith @ boresight)) < half_angle + _NEAR_NADIR_RAD
    if is_near_nadir or np.any(cosine > _STEEP_COSINE):
        columns = (-1.0, 1.0)
    else:
        columns = (float(azimuth.min()), float(azimuth.max()))
    disc = 1 - perigee2
    ground = sky = np.array([0.0, 1.0])
    has_ground = has_sky = True
    if in_view.any():
        disc_in_view = disc[in_view]
        ground = np.sqrt(np.minimum(np.maximum(disc_in_view, 0), 1))
        sky = np.sqrt(np.minimum(np.maximum(disc_in_view / (1 - top2), 0), 1))
        has_ground = bool((disc_in_view > -_GROUND_MARGIN * (top2 - 1)).any())
        has_sky = bool((perigee2[along_camera < 0] > 1 - _SKY_MARGIN * (top2 - 1)).any())
    return GlobeView(
        globe_from_camera,
        camera_position,
        sun,
        top2,
        rect,
        (0.0 if has_sky else float(ground.min()), float(ground.max())) if has_ground else None,
        (0.0 if has_ground else float(sky.min()), 1.0) if has_sky else None,
        columns,
    )


@lru_cache(maxsize=16)
def _grid_positions(length_px: int) -> FloatArray:
    """Return the columns or rows of the grid of rays [px], read-only."""
    positions = np.linspace(-0.5, length_px - 0.5, _GRID)
    positions.flags.writeable = False
    return positions


def _clip_cosine(value: FloatArray | float) -> float:
    return min(max(float(value), -1.0), 1.0)


def _globe_rect(
    hits_earth: np.typing.NDArray[np.bool_],
    perigee2: FloatArray,
    along_camera: FloatArray,
    view: View,
    camera: Camera,
    top2: float,
) -> PixelRect | None:
    """Return the pixels that the globe may touch: around the grid points that hit it, or around its projected sphere.

    None if the globe is not in the image.
    """
    width, height = camera.width_px, camera.height_px
    # a distant globe may fall between grid points
    center = -view.R_camera_from_globe @ view.r_camera_globe_m
    distance = float(np.linalg.norm(center))
    if hits_earth.any():
        rows, columns = np.nonzero(hits_earth)
        step_x, step_y = width / (_GRID - 1), height / (_GRID - 1)
        # the limb bulges less than a cell between neighbouring grid points
        x0, x1 = (columns.min() - 1) * step_x - 2, (columns.max() + 1) * step_x + 2
        y0, y1 = (rows.min() - 1) * step_y - 2, (rows.max() + 1) * step_y + 2
    elif center[2] > 0:
        # conservative bound: radius in the image of the sphere that contains globe and air
        radius = np.sqrt(top2) * view.globe.radius_m
        pixel = camera.project(center)
        size = (
            max(camera.fx_px, camera.fy_px) * radius / max(center[2], distance * _MIN_COSINE) * _STRETCH + 4
        )
        x0, y0, x1, y1 = pixel[0] - size, pixel[1] - size, pixel[0] + size, pixel[1] + size
        nearest2 = perigee2[along_camera < 0].min(initial=np.inf)
        if nearest2 > 4 * top2 and (x0 > width or y0 > height or x1 < 0 or y1 < 0):
            return None
    else:
        return None
    rect = PixelRect(
        int(max(np.floor(x0), 0)),
        int(max(np.floor(y0), 0)),
        int(min(np.ceil(x1), width)),
        int(min(np.ceil(y1), height)),
    )
    return rect if rect.width > 0 and rect.height > 0 else None


def globe_values(
    view: View, earth: GlobeView, air: Atmosphere, *, airglow: bool = False
) -> dict[str, ArrayLike]:
    """Return the members of the uniform block ``Globe``."""
    low_m, high_m = (air.radius_m + height for height in air.airglow_m)
    glow = air.airglow_w_m2_sr / view.sun_at_globe_w_m2 * float(airglow and high_m <= air.top_m)
    matrix = np.eye(4)
    matrix[:3, :3] = earth.earth_from_camera
    radius = float(np.linalg.norm(earth.camera))
    mu = earth.sun_cosine
    longitude = float(np.arctan2(earth.camera[1], earth.camera[0]))
    equator_m = view.globe.radius_m
    stretch = equator_m / view.globe.polar_radius_m
    moon = view.moon_globe * np.array([1.0, 1.0, stretch])
    return {
        "u_globe_from_camera": matrix,
        "u_globe_camera": [*earth.camera, 1 / radius],
        "u_globe_sun": [*earth.sun, mu],
        "u_globe_moon": [*(moon / np.linalg.norm(moon)), view.moon_share],
        "u_globe_irradiance": vec4_of_bands(view.sun_at_globe_w_m2),
        "u_globe_limits": [max(np.sqrt(max(1 - mu * mu, 0.0)), 1e-6), earth.top2, stretch, 0.0],
        "u_globe_meridian": [np.cos(longitude), np.sin(longitude), longitude, 0.0],
        "u_air_radius": [air.radius_m, air.top_m, radius * equator_m, SUN_ANGULAR_RADIUS_RAD],
        "u_air_sun": [mu, 0.0, 0.0, 0.0],
        "u_air_shape": [low_m, 1 / air.mie_height_m, air.mie_g, high_m],
        "u_air_layers": air.layers_m.reshape(3, 4),
        "u_air_falls": air.falls_m.reshape(3, 4),
        "u_airglow": vec4_of_bands(glow),
        "u_air_rayleigh": vec4_of_bands(air.rayleigh_m),
        "u_air_mie_scattering": vec4_of_bands(air.mie_scattering_m),
        "u_air_mie_extinction": vec4_of_bands(air.mie_extinction_m),
        "u_air_ozone": vec4_of_bands(air.ozone_m),
    }
