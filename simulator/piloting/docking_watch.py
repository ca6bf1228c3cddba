"""Docking during a flight: approach to a port, contacts with the target, and the motion after a contact."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from flyaround.simulator.piloting.docking_figures import (
    CAPTURE_M,
    CORRIDOR_DEG,
    TWO_TENTHS,
    Contact,
    docked_state,
    docking_figures,
    docking_point_target_m,
    judge_contact,
    touches_port,
)
from flyaround.simulator.piloting.docking_port import (
    distance_to_surface_m,
    docking_port,
    port_along,
    radius_m,
    target_from_lvlh,
)
from flyaround.simulator.piloting.hold_points import HoldPoints, not_ready
from flyaround.simulator.piloting.readouts import mission_time
from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_from_matrix

if TYPE_CHECKING:
    from flyaround.simulator.piloting.docking_figures import DockingFigures, DockingLimits
    from flyaround.simulator.piloting.docking_port import DockingPort
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.targets.model import Target
    from flyaround.simulator.world.flight.flight import Flight
    from flyaround.simulator.world.guidance.keep_out import KeepOut
    from flyaround.simulator.world.guidance.manual_control import ChaserState

    News = tuple[Literal["note", "caution", "warning"], str]

# Distance from the target's bounding sphere within which contact is checked in every step [m]. It bounds the cost; a
# step moves the chaser by far less.
CONTACT_CHECK_M = 1.5

# Coefficient of restitution of a contact that is not a docking; chosen, not measured.
RESTITUTION = 0.3

# Minimum speed at which the chaser leaves after such a contact [m s-1], so that it does not stick.
MIN_REBOUND_M_S = 0.01

# Distance from the port at which the next contact counts as another one [m].
REARM_DISTANCE_M = 0.5

# Attributes that a seek must restore.
SAVED_ATTRIBUTES = frozenset({"limits", "contacts", "docked", "_armed", "_port", "hold_points"})

STOPS, CONTACT = "stops the chaser", "without docking"  # parts of cautions
REMEDY = "choose Keep out: corridor at the port, in Docking"

CORRIDOR_SPAN_S, CORRIDOR_SAMPLES = 600.0, 31
"""Time ahead for which the port should stay in front of the corridor [s], that of an approach from 30 m at 0.05 m/s;
and the number of times that are checked."""


class Docking:
    """Monitor of the approach to one docking port: misalignment, hold points and contacts.

    Parameters
    ----------
    target : Target
        Model of the target.
    flight : Flight
        Flight whose start defines the direction of the port.
    keep_out : KeepOut or None
        Sphere whose corridor, if any, bounds the approach.

    Attributes
    ----------
    limits : DockingLimits
        Limits that a contact must keep to be a docking.
    corridor_deg : float
        Half angle of the approach corridor [deg].
    contacts : list of Contact
        Contacts in order of time.
    docked : bool
        True while the port holds the chaser.
    """

    def __init__(self, target: Target, flight: Flight, keep_out: KeepOut | None) -> None:
        self._target = target
        self._initial_flight = flight
        self._keep_out = keep_out
        self.limits: DockingLimits = TWO_TENTHS
        self.corridor_deg = CORRIDOR_DEG
        if keep_out is not None and keep_out.corridor_axis_lvlh is not None:
            self.corridor_deg = keep_out.corridor_half_angle_deg
        self.contacts: list[Contact] = []
        self.docked = False
        self._armed = True
        """True if the next contact is counted; a chaser that rebounds touches the port in several steps."""
        self._port: DockingPort | None = None

    @property
    def port(self) -> DockingPort:
        """The port: the target's own, unless the pilot has chosen another axis."""
        return self._port or self._own_port

    @cached_property
    def _own_port(self) -> DockingPort:
        return docking_port(self._target, self._initial_flight)

    @cached_property
    def hold_points(self) -> HoldPoints:
        """The hold points ahead of the scenario's start."""
        return HoldPoints(self.figures(self._initial_flight.chaser(0.0), self._initial_flight).range_m)

    @property
    def contact(self) -> Contact | None:
        """The last contact."""
        return self.contacts[-1] if self.contacts else None

    @cached_property
    def radius_m(self) -> float:
        """Radius of the target's bounding sphere about its centre of mass [m]."""
        return radius_m(self._target)

    def figures(self, chaser: ChaserState, flight: Flight) -> DockingFigures:
        """Compute the distances, angles and rates of the chaser relative to the port.

        Returns
        -------
        DockingFigures
            Figures at ``chaser.t_s``, with the target's attitude of ``flight``.
        """
        return docking_figures(chaser, flight.attitude(chaser.t_s), self.port)

    def closed_by(self, flight: Flight, t_s: float) -> str:
        """Describe why the keep-out sphere stops an approach to the port.

        Returns
        -------
        str
            Clause for the operator; empty without a sphere, or if the port stays in front of the corridor for
            `CORRIDOR_SPAN_S` from ``t_s`` on.
        """
        sphere = self._keep_out
        if sphere is None:
            return ""
        stops = f"the keep-out sphere of {sphere.radius_m:g} m {STOPS}; {REMEDY}"
        if sphere.corridor_axis_lvlh is None:
            return f"{stops} (it has no corridor)"
        corridor = np.array(sphere.corridor_axis_lvlh) / np.linalg.norm(sphere.corridor_axis_lvlh)
        end_s = max(t_s, min(t_s + CORRIDOR_SPAN_S, flight.duration_s))
        cosines = [
            float(self.port.axis_target @ target_from_lvlh(flight, t) @ corridor)
            for t in np.linspace(t_s, end_s, CORRIDOR_SAMPLES).tolist()
        ]
        away_deg = float(np.degrees(np.arccos(np.clip(min(cosines), -1.0, 1.0))))
        if away_deg <= sphere.corridor_half_angle_deg:
            return ""
        of_corridor = f"its corridor of {sphere.corridor_half_angle_deg:g}°"
        return f"{stops} (the port turns {away_deg:.0f}° away from {of_corridor})"

    def take_axis_here(self, chaser: ChaserState, flight: Flight) -> None:
        """Move the port to the point where the line from the chaser to the centre of mass enters the target."""
        to_target = matrix_from_quat(flight.attitude(chaser.t_s)[0]).T
        axis = to_target @ np.array(chaser.position_eci_m)
        port = port_along(self._target, axis, target_from_lvlh(flight, chaser.t_s), flight)
        self.choose_port(port, chaser, flight)

    @property
    def chosen_port(self) -> DockingPort | None:
        """The port that the pilot chose; None for the target's own."""
        return self._port

    def choose_port(self, port: DockingPort | None, chaser: ChaserState, flight: Flight) -> None:
        """Choose a port, or with None the target's own; the hold points begin again from where the chaser is."""
        self._port = port
        self.hold_points = HoldPoints(self.figures(chaser, flight).range_m)

    def not_ready(self, chaser: ChaserState, flight: Flight) -> tuple[str, ...]:
        """List the reasons against leaving the next hold point.

        Returns
        -------
        tuple of str
            Reasons for the operator; empty if there are none, or no hold point is left.
        """
        point = self.hold_points.next
        if point is None:
            return ()
        return not_ready(point, self.figures(chaser, flight), self.limits, self.corridor_deg)

    def saved_state(self) -> dict[str, Any]:
        """Return the state that a seek must restore.

        Returns
        -------
        dict
            Shallow copies of limits, contacts, port and hold points, and the flags, by name of the attribute. Hold
            points are missing if none have been computed.
        """
        return {name: copy(value) for name, value in vars(self).items() if name in SAVED_ATTRIBUTES}

    def restore_state(self, state: dict[str, Any]) -> None:
        """Restore a state that `saved_state` returned."""
        # hold points that it lacks were computed later
        for name in SAVED_ATTRIBUTES - state.keys():
            vars(self).pop(name, None)
        vars(self).update(state)

    # --- contact

    def is_near(self, chaser: ChaserState) -> bool:
        """Return True if contact is possible soon, so that every step must check for it.

        Returns
        -------
        bool
            True below `CONTACT_CHECK_M` of `gap_m`.
        """
        return self.gap_m(chaser) < CONTACT_CHECK_M

    def gap_m(self, chaser: ChaserState) -> float:
        """Compute the least possible distance between the target's sphere and the docking point.

        Returns
        -------
        float
            Distance [m], negative where the docking point can be inside the sphere.
        """
        return float(np.linalg.norm(chaser.position_eci_m)) - self.radius_m - 1.0

    def after_step(
        self, before: ChaserState, after: ChaserState, flight: Flight
    ) -> tuple[ChaserState, tuple[News, ...]]:
        """Return the chaser's state after a step, corrected if it touched the target, and messages for the operator.

        Parameters
        ----------
        before : ChaserState
            State before the step.
        after : ChaserState
            State after the step, without contact forces.
        flight : Flight
            Flight with the attitude of the target.

        Returns
        -------
        ChaserState
            State after the step, bounced off or docked.
        tuple of News
            Messages for the operator.
        """
        if not self.is_near(after):
            self._armed = True
            return after, ()
        before_figures, after_figures = self.figures(before, flight), self.figures(after, flight)
        self._armed = self._armed or after_figures.range_m > REARM_DISTANCE_M
        at_port = touches_port(before_figures, after_figures)
        if not at_port:
            if not self._strikes(before, after, flight):
                return after, ()
            # guides and latches protrude around a port
            at_port = before_figures.lateral_m <= CAPTURE_M and 0.0 < before_figures.axial_m <= CAPTURE_M
        contact = judge_contact(before_figures, self.limits, at_port=at_port)
        news: tuple[News, ...] = ()
        if self._armed:
            self._armed = False
            contact = replace(contact, t_s=after.t_s)
            self.contacts.append(contact)
            news = (_contact_news(contact),)
        if at_port and contact.docked:
            self.docked = True
            return self.held_at(after.t_s, flight), news
        return self._rebound(before, after, flight), news

    def held_at(self, t_s: float, flight: Flight) -> ChaserState:
        """Return the state of a chaser that the port holds at a time.

        Returns
        -------
        ChaserState
            State at ``t_s`` relative to the target, GCRS axes: it moves and rotates with the port.
        """
        p, v, R_camera_from_eci, turn = docked_state(flight.attitude(t_s), self.port)
        q = quat(quat_from_matrix(R_camera_from_eci))
        return replace(
            flight.chaser(t_s),
            position_eci_m=p,
            velocity_eci_m_s=v,
            q_camera_from_eci_wxyz=q,
            omega_camera_rad_s=turn,
        )

    def _strikes(self, before: ChaserState, after: ChaserState, flight: Flight) -> bool:
        """Return True if the path of the docking point, or of the camera, crossed the surface."""
        com = np.array(self._target.mass.com_m)
        for point in (docking_point_target_m, _camera_point):
            a, b = (com + point(s, flight.attitude(s.t_s)[0]) for s in (before, after))
            path = b - a
            length = float(np.linalg.norm(path))
            if length == 0.0:
                continue
            hit = distance_to_surface_m(self._target, a, path / length)
            if hit is not None and hit <= length:
                return True
        return False

    def _rebound(self, before: ChaserState, after: ChaserState, flight: Flight) -> ChaserState:
        """Return the state before the step, moving away from the target with part of its closing speed."""
        _, omega = flight.attitude(before.t_s)
        R_eci_from_target = matrix_from_quat(flight.attitude(before.t_s)[0])
        p = np.array(before.position_eci_m)
        v_surface = np.cross(R_eci_from_target @ omega, p)
        v_relative = np.array(before.velocity_eci_m_s) - v_surface
        outward = p / np.linalg.norm(p)
        closing = max(-float(v_relative @ outward), 0.0)
        v_relative = v_relative + (closing + max(RESTITUTION * closing, MIN_REBOUND_M_S)) * outward
        return replace(
            after,
            position_eci_m=before.position_eci_m,
            velocity_eci_m_s=vec3(v_surface + v_relative),
            q_camera_from_eci_wxyz=before.q_camera_from_eci_wxyz,
        )


def _camera_point(chaser: ChaserState, q_eci_from_target_wxyz: FloatArray) -> FloatArray:
    return np.asarray(matrix_from_quat(q_eci_from_target_wxyz).T @ np.array(chaser.position_eci_m))


def _contact_news(contact: Contact) -> News:
    if contact.docked:
        return "note", f"docked at {mission_time(contact.t_s)}, score {contact.score}"
    return "warning", f"contact at {mission_time(contact.t_s)} {CONTACT}: {'; '.join(contact.misses)}"
