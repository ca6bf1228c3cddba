"""The target's docking port: the one in its model, or the point where the approach axis leaves its body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.geometry.ray_cast import make_ray_caster
from flyaround.simulator.runtime.arrays import Quat, Vec3, quat, vec3
from flyaround.simulator.runtime.memory import cached_per_object
from flyaround.simulator.targets.joined_mesh import joined_mesh
from flyaround.simulator.world.attitude.pointing import DOWN_AXES_LVLH
from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_from_matrix
from flyaround.simulator.world.guidance.paths import approach_axis_lvlh

if TYPE_CHECKING:
    from flyaround.simulator.geometry.ray_cast import RayCaster
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.targets.model import Target
    from flyaround.simulator.world.flight.flight import Flight

FRAME = "docking"
"""Name of the frame of a target's model that is the port."""

_MIN_SINE = 0.2
"""Sine of the angle to the port's axis below which a reference direction is rejected."""


@dataclass(frozen=True, kw_only=True)
class DockingPort:
    """A port fixed in the target, with the axes of a docked camera: x right, y down, z into the target.

    Parameters
    ----------
    name : str
        Name for people.
    origin_m : array
        Centre of the port relative to the target's centre of mass, target axes [m].
    q_target_from_port_wxyz : array
        Orientation of its axes.
    """

    name: str
    origin_m: Vec3
    q_target_from_port_wxyz: Quat

    @property
    def axis_target(self) -> FloatArray:
        """(3,) unit vector out of the port, target axes."""
        return -matrix_from_quat(self.q_target_from_port_wxyz)[:, 2]


def docking_port(target: Target, flight: Flight) -> DockingPort:
    """Return the port of a target at the start of a flight.

    It is the frame ``docking`` of the model, or the tip of the probe that protrudes from this frame. A model without
    the frame gets a port where the approach axis of the scenario (`approach_axis_lvlh`; of a replay, that of the
    recorded one) leaves the body from its centre of mass. The port then rotates with the target.

    Parameters
    ----------
    target : Target
        Model of the target.
    flight : Flight
        Flight whose start defines the attitude and the port's down direction.
    """
    R_target_from_lvlh = target_from_lvlh(flight, 0.0)
    com = np.array(target.mass.com_m)
    if FRAME in target.frames:
        origin, axis = (np.array(x, float) for x in target.frames[FRAME])
        axis /= np.linalg.norm(axis)
        # a probe protrudes from its port, so its tip makes contact first
        body_reach = 2 * radius_m(target)
        distance = distance_to_surface_m(target, origin + body_reach * axis, -axis)
        tip = 0.0 if distance is None else max(body_reach - distance, 0.0)
        return _with_axes("docking port", origin - com + tip * axis, axis, R_target_from_lvlh, flight)
    axis_lvlh = flight.approach_axis_lvlh or approach_axis_lvlh(flight.guidance)
    return port_along(target, R_target_from_lvlh @ np.array(axis_lvlh), R_target_from_lvlh, flight)


def port_along(
    target: Target, axis_target: FloatArray, R_target_from_lvlh: FloatArray, flight: Flight
) -> DockingPort:
    """Return the port where an axis through the centre of mass leaves the body.

    Parameters
    ----------
    target : Target
        Target model.
    axis_target : (3,) array
        Outward axis, not normalised.
    R_target_from_lvlh : (3, 3) array
        Attitude; nadir is the port's down side.
    flight : Flight
        Flight of chaser and target.
    """
    axis = axis_target / np.linalg.norm(axis_target)
    com = np.array(target.mass.com_m)
    body_reach = 2 * radius_m(target)
    distance = distance_to_surface_m(target, com + body_reach * axis, -axis)
    # if the axis misses the mesh, as in a ring, use the extent of the vertices along the axis
    out = (
        float(((joined_mesh(target).hull_m - com) @ axis).max())
        if distance is None
        else body_reach - distance
    )
    return _with_axes("approach axis", out * axis, axis, R_target_from_lvlh, flight)


def target_from_lvlh(flight: Flight, t_s: float) -> FloatArray:
    """Return the (3, 3) rotation from LVLH to the target's axes."""
    q, _ = flight.attitude(t_s)
    return matrix_from_quat(q).T @ flight.orbit.frame(t_s).R_eci_from_lvlh


@cached_per_object
def radius_m(target: Target) -> float:
    """Return the radius of the target's bounding sphere about its centre of mass.

    Returns
    -------
    float
        Distance of the farthest vertex [m].
    """
    com = np.array(target.mass.com_m)
    return max(float(np.linalg.norm(part.positions_m - com, axis=1).max()) for part in target.parts)


def distance_to_surface_m(target: Target, origin_m: FloatArray, direction: FloatArray) -> float | None:
    """Return the length of the ray from a point to the surface [m], or None if it misses.

    Parameters
    ----------
    target : Target
        Target model.
    origin_m : (3,) array
        Model frame.
    direction : (3,) array
        Unit vector.
    """
    distance, triangle = _ray_caster(target).first_hits(origin_m[None], direction)
    return None if triangle[0] < 0 or not np.isfinite(distance[0]) else float(distance[0])


@cached_per_object
def _ray_caster(target: Target) -> RayCaster:
    mesh = joined_mesh(target)
    return make_ray_caster(mesh.positions_m[mesh.triangles])


def _with_axes(
    name: str, origin: FloatArray, axis: FloatArray, R_target_from_lvlh: FloatArray, flight: Flight
) -> DockingPort:
    z = -axis / np.linalg.norm(axis)
    first = "nadir" if flight.pointing.down == "auto" else flight.pointing.down
    frame_names = [first, *(name for name in DOWN_AXES_LVLH if name != first)]
    down_directions = [R_target_from_lvlh @ np.array(DOWN_AXES_LVLH[name]) for name in frame_names]
    down = next(d for d in down_directions if np.linalg.norm(np.cross(d, z)) > _MIN_SINE)
    y = down - (down @ z) * z
    y /= np.linalg.norm(y)
    axes = np.stack([np.cross(y, z), y, z], axis=1)
    return DockingPort(name=name, origin_m=vec3(origin), q_target_from_port_wxyz=quat(quat_from_matrix(axes)))
