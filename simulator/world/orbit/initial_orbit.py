"""The target's initial orbit as a user specifies it: elements, state, two-line elements or an orbit file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from msgspec import Meta

from flyaround.simulator.runtime.sections import Degrees, Inclination, Section
from flyaround.simulator.world.ephemeris.body import Body, body_named
from flyaround.simulator.world.orbit.propagation import Elements, elements_from_state, state_from_elements

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray

_MIN_SINE = 1e-3
"""Smallest |r x v| over r times the escape speed. The perigee of an orbit below it is within 2e-6 r of the centre."""


class ElementsOrbit(Section, tag_field="kind", tag="elements", frozen=True, kw_only=True):
    """Osculating Keplerian elements on GCRS axes; altitude = semi-major axis minus the body's radius."""

    centre: str = "earth"
    altitude_km: Annotated[float, Meta(ge=10, le=50_000)]
    eccentricity: Annotated[float, Meta(ge=0, le=0.9)] = 0.0
    inclination_deg: Inclination = 0.0
    raan_deg: Degrees = 0.0
    argp_deg: Degrees = 0.0
    true_anomaly_deg: Degrees = 0.0

    @property
    def body(self) -> Body:
        """The central body."""
        return body_named(self.centre)

    def state(self) -> tuple[FloatArray, FloatArray]:
        """Return the state of the elements.

        Returns
        -------
        r_eci_m : (3,) array
            Position from the centre of ``body``, GCRS axes [m].
        v_eci_m_s : (3,) array
            Velocity relative to it, GCRS axes [m s-1].
        """
        return state_from_elements(
            Elements(
                semi_major_axis_m=self.body.radius_m + self.altitude_km * 1e3,
                eccentricity=self.eccentricity,
                inclination_rad=np.radians(self.inclination_deg),
                raan_rad=np.radians(self.raan_deg),
                argument_of_perigee_rad=np.radians(self.argp_deg),
                true_anomaly_rad=np.radians(self.true_anomaly_deg),
            ),
            self.body.mu_m3_s2,
        )

    @property
    def highest_m(self) -> float:
        """Apoapsis distance from the centre of the body [m]."""
        return (self.body.radius_m + self.altitude_km * 1e3) * (1 + self.eccentricity)

    @property
    def lowest_altitude_m(self) -> float:
        """Periapsis height above the body's radius [m]."""
        return (self.body.radius_m + self.altitude_km * 1e3) * (1 - self.eccentricity) - self.body.radius_m


class StateOrbit(Section, tag_field="kind", tag="state", frozen=True, kw_only=True):
    """Position and velocity of the target's centre of mass at the epoch from ``centre``, along GCRS axes."""

    centre: str = "earth"
    r_eci_km: tuple[float, float, float]
    v_eci_km_s: tuple[float, float, float]

    @property
    def body(self) -> Body:
        """The central body."""
        return body_named(self.centre)

    def state(self) -> tuple[FloatArray, FloatArray]:
        """Return the state in SI units.

        Returns
        -------
        r_eci_m : (3,) array
            Position from the centre of ``body``, GCRS axes [m].
        v_eci_m_s : (3,) array
            Velocity relative to it, GCRS axes [m s-1].
        """
        return np.array(self.r_eci_km) * 1e3, np.array(self.v_eci_km_s) * 1e3

    def problem(self) -> tuple[str, str] | None:
        """Return why the state is not an allowed orbit.

        Returns
        -------
        tuple of str or None
            Subject and end of a sentence; None if the orbit is bound, higher than the body's ``lowest_m`` at its
            periapsis, and no fall.
        """
        (r, v), body = self.state(), self.body
        radius, speed = float(np.linalg.norm(r)), float(np.linalg.norm(v))
        distance = body.distance_problem(radius)
        if distance:
            return "key orbit.r_eci_km", distance
        escape = float(np.sqrt(2 * body.mu_m3_s2 / radius))
        # also not a number
        if not speed < escape:
            return "key orbit.v_eci_km_s", (
                f"is {speed / 1e3:.3f} km/s fast, allowed: less than the {escape / 1e3:.3f} km/s that "
                f"leave {body.title}"
            )
        if float(np.linalg.norm(np.cross(r, v))) < _MIN_SINE * radius * escape:
            return "key orbit.v_eci_km_s", "points along orbit.r_eci_km, allowed: an orbit, not a fall"
        e = elements_from_state(r, v, body.mu_m3_s2)
        altitude = e.semi_major_axis_m * (1 - e.eccentricity) - body.radius_m
        if altitude < body.lowest_m:
            return "section [orbit]", (
                f"has its lowest point {altitude / 1e3:.0f} km high, allowed: at least "
                f"{body.lowest_m / 1e3:.0f} km above {body.title}"
            )
        return None


class TleOrbit(Section, tag_field="kind", tag="tle", frozen=True, kw_only=True):
    """Two-line elements, propagated by SGP4 to the scenario's epoch and by the forces from there.

    Two lines, or a ``file`` of them (a path from the scenario's folder); of several sets the ``satellite`` named.
    """

    line1: str | None = None
    line2: str | None = None
    file: str | None = None
    satellite: str | None = None


class OemOrbit(Section, tag_field="kind", tag="oem", frozen=True, kw_only=True):
    """An orbit file (path relative to the scenario's folder): CCSDS OEM, OPM or OMM, or two-line elements.

    An OEM is interpolated for the whole flight. With ``motion = "propagate"``, and for files of a single state, the
    forces move the target from the state at the scenario's epoch.
    """

    centre: str = "earth"
    file: str
    # unless given: oem for an OEM, propagate for the others
    motion: Literal["oem", "propagate"] | None = None
    # name or identifier, of a file with several
    satellite: str | None = None


ResolvedOrbit = ElementsOrbit | StateOrbit
"""Orbits that give a state; the others become a `StateOrbit` when their message is read."""
