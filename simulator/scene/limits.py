"""Limits of a scene read from a file: every number finite and within its physical range."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from msgspec import UnsetType

from flyaround.simulator.camera.detector.limits import (
    focus_problem,
    optics_problem,
    response_problem,
    sensor_problem,
)
from flyaround.simulator.camera.detector.shutter import EXPOSURE_S, READOUT_S
from flyaround.simulator.camera.lens.camera_model import (
    CENTRE_PX,
    FOCAL_PX,
    MAX_IMAGE_PX,
    camera_problem,
)
from flyaround.simulator.errors import UserError
from flyaround.simulator.world.ephemeris.body import body_named
from flyaround.simulator.world.time.instant import Instant

if TYPE_CHECKING:
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.world.ephemeris.body import BodyState

# Range of the target's distance [m]: nearer, single precision does not resolve its depth; farther, it is below a pixel
# of any lens.
MAX_TARGET_DISTANCE_M = 1e6
TARGET_DISTANCE_M = (0.01, MAX_TARGET_DISTANCE_M)
# Geocentric distances [m]: of craft, from below the Earth's surface at the poles to far beyond the Sun; of other
# bodies, from a minor planet's reach; of the Sun, about 1 au; of the Moon, about its 3.6e8 to 4.1e8.
CRAFT_M, BODY_M, SUN_M, MOON_M = (6.0e6, 1e12), (1e6, 1e12), (1e11, 2e11), (1e8, 1e9)
AIR_KM, AEROSOL_DEPTH = (
    (5.0, 200.0),
    (0.0, 1.0),
)  # as thin as the lowest layer, up to thermosphere; clear to dust storm
# Length of a quaternion: written with 7 digits or more.
UNIT = (1 - 1e-6, 1 + 1e-6)
# Largest factor on reflectance and roughness of a varied target, far beyond any material.
MAX_FACTOR = 100.0
MAX_STRETCH = 0.2  # largest stretch of a target along an axis, as a share
MAX_SPEED_M_S, MAX_RATE_RAD_S = 1e6, 1e4  # far beyond any craft


def scene_problem(scene: SceneState) -> str | None:
    """Describe the first field of a scene that is out of range.

    Returns
    -------
    str or None
        Field, value and allowed range; None if the scene has no such field.
    """
    c, (earth, moon, *other_bodies) = scene.camera, scene.bodies
    names = [b.name for b in scene.bodies]
    if scene.central_body not in names or len(set(names)) < len(names):
        return f"scene.central_body is {scene.central_body!r} and the scene's bodies are {', '.join(names)}"
    try:
        for name in names:
            body_named(name)
    except UserError as error:
        return f"scene.bodies: {error}"
    ranges = (
        ("scene.camera.width_px", c.width_px, 1, MAX_IMAGE_PX),
        ("scene.camera.height_px", c.height_px, 1, MAX_IMAGE_PX),
        ("scene.camera.fx_px", c.fx_px, *FOCAL_PX),
        ("scene.camera.fy_px", c.fy_px, *FOCAL_PX),
        ("scene.camera.cx_px", c.cx_px, *CENTRE_PX),
        ("scene.camera.cy_px", c.cy_px, *CENTRE_PX),
        ("scene.exposure_s", scene.exposure_s, *EXPOSURE_S),
        ("scene.shutter.readout_s", scene.shutter.readout_s, *READOUT_S),
        ("scene.seed", scene.seed, 0, 2**63 - 1),
        ("scene.frame_index", scene.frame_index, 0, 2**31 - 1),
        ("scene.sun_visible_fraction", scene.sun_visible_fraction, 0.0, 1.0),
        ("|scene.t_camera_from_target_m|", _norm(scene.t_camera_from_target_m), *TARGET_DISTANCE_M),
        ("|scene.r_camera_eci_m|", _norm(scene.r_camera_eci_m), *CRAFT_M),
        ("|scene.r_target_eci_m|", _norm(scene.r_target_eci_m), *CRAFT_M),
        ("|scene.r_sun_eci_m|", _norm(scene.r_sun_eci_m), *SUN_M),
        ("|scene.r_moon_eci_m|", _norm(moon.r_eci_m), *MOON_M),
        ("|scene.v_camera_eci_m_s|", _norm(scene.v_camera_eci_m_s), 0.0, MAX_SPEED_M_S),
        ("|scene.v_target_eci_m_s|", _norm(scene.v_target_eci_m_s), 0.0, MAX_SPEED_M_S),
        ("|scene.v_target_camera_m_s|", _norm(scene.v_target_camera_m_s), 0.0, MAX_SPEED_M_S),
        ("|scene.omega_camera_rad_s|", _norm(scene.omega_camera_rad_s), 0.0, MAX_RATE_RAD_S),
        ("|scene.omega_target_rad_s|", _norm(scene.omega_target_rad_s), 0.0, MAX_RATE_RAD_S),
        ("scene.environment.atmosphere_thickness_km", scene.environment.atmosphere_thickness_km, *AIR_KM),
        ("scene.environment.aerosol_optical_depth", scene.environment.aerosol_optical_depth, *AEROSOL_DEPTH),
        ("|scene.q_camera_from_target_wxyz|", _norm(scene.q_camera_from_target_wxyz), *UNIT),
        ("|scene.q_camera_from_eci_wxyz|", _norm(scene.q_camera_from_eci_wxyz), *UNIT),
        ("|scene.q_itrs_from_eci_wxyz|", _norm(earth.q_fixed_from_eci_wxyz), *UNIT),
        ("|scene.q_moon_from_eci_wxyz|", _norm(moon.q_fixed_from_eci_wxyz), *UNIT),
        *(r for k, b in enumerate(other_bodies) for r in _body_ranges(f"scene.bodies[{k}]", b)),
    )
    for name, value, low, high in ranges:
        if not low <= value <= high:  # NaN fails too
            # an integer may have more digits than a float can hold
            text = f"{value:g}" if abs(value) < 2**63 else "far beyond"
            return f"{name} is {text}, allowed: {low:g} to {high:g}"
    variation = scene.target.variation
    if not isinstance(variation, UnsetType):
        factors = [x for s in variation.surfaces.values() for x in (s.reflectance, s.roughness)]
        if not np.abs(variation.stretch).max() <= MAX_STRETCH or not all(
            0 <= x <= MAX_FACTOR for x in factors
        ):
            return f"scene.target.variation: its stretch is at most {MAX_STRETCH:g}, its factors 0 to {MAX_FACTOR:g}"
    imaging = imaging_problem(scene)
    if imaging is not None:
        return imaging
    try:
        Instant.from_utc(scene.epoch_utc)
    except ValueError as error:
        return f"scene.epoch_utc: {error}"
    return None


def imaging_problem(scene: SceneState) -> str | None:
    """Describe the first field of a scene's lens, optics and sensor that is out of range or does not fit the others.

    Returns
    -------
    str or None
        Field, value and allowed range; None if all fit.
    """
    lens = camera_problem(scene.camera)
    if lens is not None:
        return f"scene.camera.{lens}"
    part = (
        sensor_problem(scene.sensor)
        or optics_problem(scene.optics)
        or focus_problem(scene.optics, scene.camera, scene.sensor)
        or response_problem(scene.sensor, scene.optics, 1 if scene.bands == "mono" else 3)
    )
    if part is not None:
        return f"scene.{part}"
    detector = scene.sensor.detector
    if detector is not None and detector.colour_filter != "none" and scene.bands == "mono":
        return (
            f"scene.sensor.detector.colour_filter is {detector.colour_filter!r}, which needs scene.bands rgb"
        )
    return None


def _body_ranges(source: str, state: BodyState) -> tuple[tuple[str, float, float, float], ...]:
    return (
        (f"|{source}.r_eci_m|", _norm(state.r_eci_m), *BODY_M),
        (f"|{source}.q_fixed_from_eci_wxyz|", _norm(state.q_fixed_from_eci_wxyz), *UNIT),
    )


def _norm(values: tuple[float, ...]) -> float:
    with np.errstate(over="ignore"):
        return float(np.linalg.norm(values))
