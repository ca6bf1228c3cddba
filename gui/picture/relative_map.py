"""Geometry of the LVLH map: two planes at one scale, fitting, and outlines of corridor and target."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import ConvexHull

from flyaround.simulator.runtime.arrays import Vec3, vec3
from flyaround.simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.targets.model import Target
    from flyaround.simulator.world.flight.world_state import WorldState
    from flyaround.simulator.world.frames.lvlh import Lvlh
    from flyaround.simulator.world.guidance.keep_out import KeepOut

Rect = tuple[float, float, float, float]
"""x, y, width, height on the screen."""
LEAST_WIDTH_M, MOST_WIDTH_M = 0.5, 2_000_000.0
FIT_MARGIN = 1.16  # width of the map over the width of what it must show
KEPT_UNTIL = 1.7
"""Ratio by which the content must shrink before a fitted map is enlarged."""
_CIRCLE = 48  # points of the drawn sphere


@dataclass(frozen=True)
class Plane:
    """A plane of the map.

    Parameters
    ----------
    name : str
        Name for people.
    right : int
        LVLH axis to the right (0 radial, 1 along-track, 2 cross-track).
    up : int
        LVLH axis upwards.
    up_title : str
        Label of the upward direction.
    note : str, optional
        Text beside the map.
    """

    name: str
    right: int
    up: int
    up_title: str
    note: str = ""

    @property
    def through(self) -> int:
        """The axis perpendicular to the plane."""
        return 3 - self.right - self.up


IN_PLANE = Plane("in plane", 1, 0, "radial", ", out")
OUT_OF_PLANE = Plane("out of plane", 1, 2, "cross-track")


@dataclass
class MapLook:
    """Centre and scale of the map.

    Parameters
    ----------
    centre_lvlh_m : Vec3, optional
        Centre of both planes.
    width_m : float, optional
        Width of a plane.
    fitted : bool, optional
        True while it follows its content, until the operator moves it.
    """

    centre_lvlh_m: Vec3 = (0.0, 0.0, 0.0)
    width_m: float = 50.0
    fitted: bool = True

    def place(self, centre_lvlh_m: Vec3, width_m: float) -> None:
        """Show a region, and stop following the flight."""
        self.centre_lvlh_m = centre_lvlh_m
        self.width_m = min(max(width_m, LEAST_WIDTH_M), MOST_WIDTH_M)
        self.fitted = False


@dataclass(frozen=True)
class MapPort:
    """One plane on the screen, with one scale for both axes.

    Parameters
    ----------
    plane : Plane
        The plane of LVLH shown.
    rect : Rect
        Screen rectangle.
    centre_lvlh_m : Vec3
        Position shown at the centre.
    scale : float
        Screen units per metre.
    """

    plane: Plane
    rect: Rect
    centre_lvlh_m: Vec3
    scale: float

    def at(self, points_lvlh_m: FloatArray | Sequence[float]) -> FloatArray:
        """Return screen positions (..., 2) of points (..., 3)."""
        p = np.asarray(points_lvlh_m, float) - np.array(self.centre_lvlh_m)
        x, y, w, h = self.rect
        across, down = p[..., self.plane.right], -p[..., self.plane.up]
        return np.stack([x + w / 2 + self.scale * across, y + h / 2 + self.scale * down], axis=-1)

    def point(self, x: float, y: float, through_m: float = 0.0) -> Vec3:
        """Return the position under a screen point, at a height above the plane [m]."""
        left, top, w, h = self.rect
        p = np.zeros(3)
        p[self.plane.right] = self.centre_lvlh_m[self.plane.right] + (x - left - w / 2) / self.scale
        p[self.plane.up] = self.centre_lvlh_m[self.plane.up] - (y - top - h / 2) / self.scale
        p[self.plane.through] = through_m
        return vec3(p)

    def inside(self, x: float, y: float) -> bool:
        """Return True if a screen point lies in it."""
        left, top, w, h = self.rect
        return left <= x < left + w and top <= y < top + h

    @property
    def width_m(self) -> float:
        """Width of the plane [m]."""
        return self.rect[2] / self.scale


def ports(rect: Rect, look: MapLook, gap: float = 6.0) -> tuple[MapPort, MapPort]:
    """Return both planes side by side, or one above the other if the rectangle is less than twice as wide as high."""
    x, y, w, h = rect
    if w > 1.8 * h:
        half = max((w - gap) / 2, 1.0)
        rects = (x, y, half, h), (x + half + gap, y, half, h)
    else:
        half = max((h - gap) / 2, 1.0)
        rects = (x, y, w, half), (x, y + half + gap, w, half)
    scale = max(rects[0][2], 1.0) / look.width_m
    centre = look.centre_lvlh_m
    return MapPort(IN_PLANE, rects[0], centre, scale), MapPort(OUT_OF_PLANE, rects[1], centre, scale)


def fit(look: MapLook, points_lvlh_m: FloatArray, aspect: float) -> None:
    """Bring points into view in both planes; a view that still fits well is kept, so that it does not drift.

    Parameters
    ----------
    look : MapLook
        Centre and width of the map, modified if necessary.
    points_lvlh_m : (n, 3) array
        Positions.
    aspect : float
        Width over height of a plane on the screen.
    """
    low, high = points_lvlh_m.min(axis=0), points_lvlh_m.max(axis=0)
    size = high - low
    needed_m = max(float(size[1]), float(max(size[0], size[2])) * aspect, LEAST_WIDTH_M)
    visible_m = np.array([look.width_m / aspect, look.width_m, look.width_m / aspect])
    centre = np.array(look.centre_lvlh_m)
    holds = bool(np.all(np.abs(np.stack([low, high]) - centre) <= visible_m / 2))
    if holds and look.width_m <= KEPT_UNTIL * FIT_MARGIN * needed_m:
        return
    look.centre_lvlh_m = vec3((low + high) / 2)
    look.width_m = min(FIT_MARGIN * needed_m, MOST_WIDTH_M)


def nice_step(length_m: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that is not longer."""
    power = 10.0 ** math.floor(math.log10(length_m))
    # a small term, because rounding may turn 5 into 4.999...
    return next(m * power for m in (5.0, 2.0, 1.0) if m * power <= length_m * (1 + 1e-9))


def metres_text(metres: float) -> str:
    """Return a length with its unit."""
    if abs(metres) >= 1000:
        return f"{metres / 1000:g} km"
    return f"{metres:g} m" if abs(metres) >= 1 or metres == 0 else f"{100 * metres:g} cm"


def corridor_outline(keep_out: KeepOut, plane: Plane) -> FloatArray:
    """Return the (n, 3) outline in the plane of the approach corridor inside the keep-out sphere; empty without one."""
    if keep_out.corridor_axis_lvlh is None:
        return np.zeros((0, 3))
    axis = np.array(keep_out.corridor_axis_lvlh, float)
    axis /= np.linalg.norm(axis)
    half = math.radians(keep_out.corridor_half_angle_deg)
    side = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    side /= np.linalg.norm(side)
    other = np.cross(axis, side)
    turn = np.linspace(0, 2 * np.pi, _CIRCLE, endpoint=False)[:, None]
    around = np.cos(turn) * side + np.sin(turn) * other
    rim = keep_out.radius_m * (math.cos(half) * axis + math.sin(half) * around)
    # the cap of the sphere, which bulges beyond the rim
    tip = keep_out.radius_m * axis
    cap = np.vstack([rim + (tip - rim) * s for s in (0.0, 0.25, 0.5, 0.75, 1.0)])
    cap *= keep_out.radius_m / np.linalg.norm(cap, axis=1, keepdims=True)
    return hull(np.vstack([np.zeros((1, 3)), cap]), plane)


def hull(points_lvlh_m: FloatArray, plane: Plane) -> FloatArray:
    """Return the points (m, 3) on the convex hull of a cloud (n, 3) in a plane, in order."""
    return points_lvlh_m[ConvexHull(points_lvlh_m[:, [plane.right, plane.up]]).vertices]


def target_edges_lvlh_m(target: Target, world: WorldState, frame: Lvlh) -> FloatArray:
    """Return the target's wireframe in the LVLH frame, relative to its centre of mass, (n, 2, 3) [m]."""
    ends = np.array([(e.a_m, e.b_m) for e in target.wireframe], float).reshape(-1, 2, 3)
    R_lvlh_from_target = frame.R_eci_from_lvlh.T @ matrix_from_quat(world.q_eci_from_target_wxyz)
    return (ends - np.array(target.mass.com_m)) @ R_lvlh_from_target.T


def sun_lvlh(world: WorldState, frame: Lvlh) -> FloatArray:
    """Return (3,) unit vector from the target to the Sun, LVLH axes."""
    to_sun = np.array(world.r_sun_eci_m) - np.array(world.r_target_eci_m)
    return np.asarray(frame.R_eci_from_lvlh.T @ (to_sun / np.linalg.norm(to_sun)))


def boresight_lvlh(world: WorldState, frame: Lvlh) -> FloatArray:
    """Return (3,) unit vector along the camera's boresight, LVLH axes."""
    return np.asarray(frame.R_eci_from_lvlh.T @ matrix_from_quat(world.q_camera_from_eci_wxyz)[2])
