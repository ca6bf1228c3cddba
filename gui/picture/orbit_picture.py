"""The free camera's picture: the same world from another position, with the chaser drawn over it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flyaround.gui.picture.light_settings import lit
from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.imaging.auto_exposure import AutoExposure
from flyaround.simulator.imaging.metering import metered_exposure_s
from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.scene.build import build_scene
from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_from_matrix

if TYPE_CHECKING:
    from flyaround.gui.picture.orbit_camera import OrbitCamera
    from flyaround.gui.picture.view_settings import ViewSettings
    from flyaround.simulator.piloting.session import FlightSession
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.state import Quality, SceneState
    from flyaround.simulator.world.flight.world_state import WorldState
    from flyaround.simulator.world.frames.lvlh import Lvlh

FIELD_DEG = 40.0
"""Vertical field of view."""
TRAIL_POINTS = 300  # points of the drawn trail
_METER = AutoExposure(level=0.45, share=0.9, longest_s=0.25)  # exposure of the view from outside
_NEAR_M = 0.02
_LEAST_PX = (304, 128)
"""Size below which craft and trail blur; a busy machine draws fewer pictures instead."""


def orbit_scene(
    session: FlightSession, settings: ViewSettings, look: OrbitCamera, divisor: int, quality: Quality | None
) -> SceneState:
    """Return the scene of the free camera: the same world and target, metered exposure, no noise.

    The chaser's lamp and lights fixed to its camera are omitted, because they would move along.

    Parameters
    ----------
    session : FlightSession
        The flight at its present time.
    settings : ViewSettings
        Settings of the view.
    look : OrbitCamera
        The free camera.
    divisor : int
        View pixels per drawn pixel, less in a small view.
    quality : Quality or None
        Replaces the default.
    """
    divisor = min(divisor, *(max(s // least, 1) for s, least in zip(look.size_px, _LEAST_PX, strict=True)))
    own = lit(session.scene(), settings.lights)
    world = seen_from(session.craft.world, session.flight.lvlh(session.t_s), look)
    scene = build_scene(
        world,
        camera=pinhole(*(max(s // divisor, 16) for s in look.size_px)),
        sensor=sensor_preset("ideal"),
        exposure_s=1e-3,
        target=own.target,
        com_target_m=session.plan.target.mass.com_m,
        frame_index=0,
        seed=0,
        quality=quality or "default",
        bands=settings.bands,
        environment=settings.environment,
        lights=[light for light in own.area_lights if light.frame == "target"],
    )
    exposure = metered_exposure_s(_METER, scene, session.plan.target) * 2.0**settings.exposure_stops
    return replace(scene, exposure_s=exposure)


def seen_from(world: WorldState, frame: Lvlh, look: OrbitCamera) -> WorldState:
    """Return the world with the free camera at the chaser's position, at rest in LVLH."""
    R = frame.R_eci_from_lvlh
    away, up = R @ look.from_focus_lvlh, R[:, 0]
    focus = np.zeros(3) if look.about == "target" else np.array(world.relative_eci_m)
    place = focus + look.distance_m * away
    right = np.cross(-away, up)
    right /= np.linalg.norm(right)
    R_camera_from_eci = np.stack([right, np.cross(-away, right), -away])
    rate = np.cross(frame.omega_eci_rad_s, place)
    return replace(
        world,
        r_chaser_eci_m=vec3(np.array(world.r_target_eci_m) + place),
        v_chaser_eci_m_s=vec3(np.array(world.v_target_eci_m_s) + rate),
        q_camera_from_eci_wxyz=quat(quat_from_matrix(R_camera_from_eci)),
        omega_camera_rad_s=vec3(R_camera_from_eci @ frame.omega_eci_rad_s),
        relative_eci_m=vec3(place),
        relative_eci_m_s=vec3(rate),
    )


@lru_cache(maxsize=16)
def pinhole(width_px: int, height_px: int) -> Camera:
    """Return a camera without distortion, ``FIELD_DEG`` high."""
    f = height_px / 2 / math.tan(math.radians(FIELD_DEG / 2))
    return Camera(
        width_px=width_px,
        height_px=height_px,
        fx_px=f,
        fy_px=f,
        cx_px=(width_px - 1) / 2,
        cy_px=(height_px - 1) / 2,
    )


@dataclass(frozen=True)
class ChaserMarks:
    """The chaser in the free camera's picture [px]; NaN behind the camera.

    Parameters
    ----------
    place : (2,) array
        Position of its camera.
    frustum : (n, 2, 2) array
        Lines of the camera's field of view.
    axes : (3, 2, 2) array
        Lines of its camera's axes.
    trail : (n, 2) array
        Flown path.
    range_m : float
        Distance from the free camera.
    """

    place: FloatArray
    frustum: FloatArray
    axes: FloatArray
    trail: FloatArray
    range_m: float


def chaser_marks(
    scene: SceneState, world: WorldState, chaser: Camera, frame: Lvlh, trail_lvlh_m: FloatArray
) -> ChaserMarks:
    """Return the marks of the chaser in the free camera's picture.

    Parameters
    ----------
    scene : SceneState
        Scene of the free camera.
    world : WorldState
        State of the flight at the same time.
    chaser : Camera
        The chaser's camera.
    frame : Lvlh
        LVLH at that time.
    trail_lvlh_m : (n, 3) array
        Flown path.
    """
    R_free_from_eci = matrix_from_quat(scene.q_camera_from_eci_wxyz)
    eye = np.array(scene.r_camera_eci_m) - np.array(scene.r_target_eci_m)
    at = R_free_from_eci @ (np.array(world.relative_eci_m) - eye)
    R_free_from_chaser = R_free_from_eci @ matrix_from_quat(world.q_camera_from_eci_wxyz).T
    distance = float(np.linalg.norm(at))
    size = max(0.08 * distance, 0.15)
    right, low = chaser.width_px - 0.5, chaser.height_px - 0.5
    rays = 2.2 * size * chaser.rays([(-0.5, -0.5), (right, -0.5), (right, low), (-0.5, low)])
    lines = [(np.zeros(3), r) for r in rays] + [(rays[k], rays[(k + 1) % 4]) for k in range(4)]
    axes = np.stack([np.stack([np.zeros(3), size * e]) for e in np.eye(3)])
    trail = (R_free_from_eci @ (frame.R_eci_from_lvlh @ trail_lvlh_m[:, :].T - eye[:, None])).T

    def project(points: FloatArray) -> FloatArray:
        ahead = np.where(points[..., 2:] > _NEAR_M, points, np.nan)
        return scene.camera.project(ahead)

    return ChaserMarks(
        place=project(at),
        frustum=project(np.array(lines) @ R_free_from_chaser.T + at),
        axes=project(axes @ R_free_from_chaser.T + at),
        trail=project(trail),
        range_m=distance,
    )
