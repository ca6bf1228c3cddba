"""Bodies of the solar system (shape, gravity, rotation, albedo, air, position, orientation) and their registry."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.arrays import Quat, Vec3, quat, vec3
from flyaround.simulator.runtime.plugins import plugins
from flyaround.simulator.world.constants import AU_M, LIGHT_M_S
from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_from_matrix

if TYPE_CHECKING:
    from collections.abc import Mapping

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.time.instant import Instant

BUILT_IN = {
    "earth": ("flyaround.simulator.world.bodies.earth", "EARTH"),
    "moon": ("flyaround.simulator.world.bodies.moon", "MOON"),
}
"""Module and attribute of the bodies that every scene holds, in the order of `bodies_at`."""
MAX_LAYERS = 13
"""Largest number of heights in `BodyAir.density`: shaders hold one layer per interval, in three vectors of four."""
_IDENTITY: Quat = (1.0, 0.0, 0.0, 0.0)  # no rotation
MIN_GROUND_MOTION_RAD_S = 1e-5
"""Rotation rate below which the ground moves by less than 1 % of the orbital motion of a low orbit."""


@dataclass(frozen=True, kw_only=True)
class BodyAir:
    """Clear atmosphere of a body, with one kind of aerosol.

    Parameters
    ----------
    rayleigh_m_um4 : float
        Rayleigh scattering at the ground times wavelength^4 [m-1 um^4].
    rayleigh_height_m : float
        Scale height of the gas [m].
    rayleigh_dispersion_um : tuple of float, optional
        Coefficients of wavelength^-2 [um^2] and wavelength^-4 [um^4], added to 1.
    density : tuple of tuple of float, optional
        (height [m], density) pairs, heights increasing from 0, which replace ``rayleigh_height_m``. Density is
        exponential between and beyond them. At most `MAX_LAYERS` pairs.
    aerosol_m : float, optional
        Extinction of the aerosol at the ground at 550 nm [m-1].
    aerosol_albedo : float, optional
        Single-scattering albedo of the aerosol.
    aerosol_height_m : float, optional
        Scale height of the aerosol [m].
    aerosol_exponent : float, optional
        Angstrom exponent.
    aerosol_g : float, optional
        Asymmetry of its phase function.
    ozone_m : mapping, optional
        Absorption [m-1] at the peak, 25 km high, of a layer from 10 to 40 km, by name of the band.
    airglow_w_m2_sr : mapping, optional
        Radiance of the airglow at the zenith [W m-2 sr-1], by name of the band.
    airglow_m : tuple of float, optional
        Lower and upper edge [m].
    thickness_m : float, optional
        Height of the top [m].

    Raises
    ------
    ValueError
        If a height, density or coefficient is out of range, or the heights of the density do not increase.
    """

    rayleigh_m_um4: float
    rayleigh_height_m: float
    rayleigh_dispersion_um: tuple[float, float] = (0.0, 0.0)
    density: tuple[tuple[float, float], ...] = ()
    aerosol_m: float = 0.0
    aerosol_albedo: float = 1.0
    aerosol_height_m: float = 1000.0
    aerosol_exponent: float = 0.0
    aerosol_g: float = 0.76
    ozone_m: Mapping[str, float] = field(default_factory=dict, hash=False)
    airglow_w_m2_sr: Mapping[str, float] = field(default_factory=dict, hash=False)
    airglow_m: tuple[float, float] = (85_000.0, 100_000.0)
    thickness_m: float = 100_000.0

    def __post_init__(self) -> None:
        """Raise ValueError if a number describes no atmosphere, or the shaders cannot hold the density profile."""
        heights = (self.rayleigh_height_m, self.aerosol_height_m, self.thickness_m)
        if not all(0 < height < math.inf for height in heights):
            raise ValueError(
                f"BodyAir: rayleigh_height_m, aerosol_height_m, thickness_m are {heights}, allowed: more than 0"
            )
        if not (0 <= self.rayleigh_m_um4 < math.inf and 0 <= self.aerosol_m < math.inf):
            raise ValueError(
                f"BodyAir: rayleigh_m_um4 is {self.rayleigh_m_um4:g} and aerosol_m {self.aerosol_m:g}, "
                "allowed: 0 or more"
            )
        if not (0 <= self.aerosol_albedo <= 1 and -1 < self.aerosol_g < 1):
            raise ValueError(
                f"BodyAir: aerosol_albedo is {self.aerosol_albedo:g} and aerosol_g {self.aerosol_g:g}, "
                "allowed: 0 to 1, and between -1 and 1"
            )
        if len(self.density) == 1 or len(self.density) > MAX_LAYERS:
            raise ValueError(
                f"BodyAir.density has {len(self.density)} heights, allowed: none, or 2 to {MAX_LAYERS}"
            )
        levels = [height for height, _ in self.density]
        if levels and (levels[0] != 0 or not all(a < b < math.inf for a, b in pairwise(levels))):
            raise ValueError(f"BodyAir.density has the heights {levels}, allowed: increasing from 0")
        if not all(0 < density < math.inf for _, density in self.density):
            raise ValueError("BodyAir.density has a density that is not above 0 and finite")


@dataclass(frozen=True, kw_only=True)
class Body(ABC):
    """A body that craft can orbit; a subclass defines its position and orientation.

    Parameters
    ----------
    name : str
        Name in lower case.
    title : str
        Name in a sentence.
    mu_m3_s2 : float
        Gravitational parameter.
    radius_m : float
        Equatorial radius of the ellipsoid [m]; altitudes are above it.
    mean_radius_m : float
        Radius of a sphere of similar size [m].
    flattening : float, optional
        Flattening of the ellipsoid.
    j2 : float, optional
        Second zonal harmonic of the simple gravity model, with ``radius_m``.
    turn_rad_s : float
        Sidereal rotation rate.
    lowest_m : float
        Perigee altitude below which an orbit is probably a mistake.
    reach_m : float
        Radius of its sphere of influence, which limits orbits (Vallado 2013, patched conics).
    albedo : float
        Mean reflectance, used without a map.
    sun_distance_m : float, optional
        Mean distance from the Sun, for metering.
    albedo_map : str, optional
        Path of an equirectangular grey image of the reflectance (full scale is 1), north up, 180 degrees west at its
        left edge.
    air : BodyAir, optional
        None without atmosphere.
    surface : str, optional
        Render passes; see docs/adr/0025-bodies-are-objects.md.
    layer : str, optional
        Switch of the environment that shows the body.
    degrees : tuple of int, optional
        Allowed values of ``forces.gravity_degree``.
    acting : tuple of str, optional
        Other supported keys of [forces].
    has_field : bool, optional
        True if its magnetic field exerts a torque on a residual dipole.
    """

    name: str
    title: str
    mu_m3_s2: float
    radius_m: float
    mean_radius_m: float
    flattening: float = 0.0
    j2: float = 0.0
    turn_rad_s: float
    lowest_m: float
    reach_m: float
    albedo: float
    sun_distance_m: float = AU_M
    albedo_map: str | None = None
    air: BodyAir | None = None
    surface: str = "globe"
    layer: str = "moon"
    degrees: tuple[int, ...] = (0,)
    acting: tuple[str, ...] = ()
    has_field: bool = False

    @abstractmethod
    def geocentric_state(self, now: Instant) -> tuple[FloatArray, FloatArray]:
        """Return the geometric position [m] and velocity [m s-1] of its centre from the Earth's, GCRS, each (3,).

        Returns
        -------
        tuple of array
            Position (3,) [m] and velocity (3,) [m s-1].
        """

    @abstractmethod
    def q_fixed_from_eci(self, now: Instant) -> FloatArray:
        """Return the orientation of its body-fixed axes (z to the pole, x to longitude 0) as a unit quaternion.

        Returns
        -------
        (4,) array
            Quaternion, Hamilton, scalar first.
        """

    def apparent_m(self, now: Instant) -> FloatArray:
        """Return the apparent position (3,) from the Earth's centre, corrected for light time, GCRS axes [m].

        Returns
        -------
        (3,) array
            Position [m].
        """
        r, v = self.geocentric_state(now)
        return np.asarray(r - v * (float(np.linalg.norm(r)) / LIGHT_M_S))

    @property
    def polar_radius_m(self) -> float:
        """Polar radius of the ellipsoid [m]."""
        return self.radius_m * (1 - self.flattening)

    def pole_eci(self, now: Instant) -> FloatArray:
        """Return the unit vector (3,) along its axis, GCRS.

        Returns
        -------
        (3,) array
            Unit vector.
        """
        return matrix_from_quat(self.q_fixed_from_eci(now))[2]

    @property
    def turns(self) -> bool:
        """True if its ground rotates fast enough to be seen during an exposure."""
        return self.turn_rad_s > MIN_GROUND_MOTION_RAD_S

    def distance_problem(self, distance_m: float) -> str | None:
        """Return why a distance from its centre is not allowed, as the end of a sentence; None if it is allowed.

        Returns
        -------
        str or None
            End of a sentence whose subject is the craft.
        """
        limit = None
        if not distance_m >= self.radius_m + self.lowest_m:
            limit = f"at least {(self.radius_m + self.lowest_m) / 1e3:.0f} km"
        elif not distance_m <= self.reach_m:
            limit = f"at most {self.reach_m / 1e3:.0f} km"
        if limit is None:
            return None
        return f"is {distance_m / 1e3:.1f} km from the centre of {self.title}, allowed: {limit}"


@dataclass(frozen=True, kw_only=True)
class BodyState:
    """The state of a body at one time.

    Parameters
    ----------
    name : str
        Name of the body.
    r_eci_m : tuple of float
        Centre of the body from the Earth's centre, GCRS axes [m]; apparent, but geometric for the central body.
    q_fixed_from_eci_wxyz : tuple of float
        Orientation of the body-fixed axes, unit quaternion, scalar first.
    """

    name: str
    r_eci_m: Vec3
    q_fixed_from_eci_wxyz: Quat

    @property
    def body(self) -> Body:
        """The body."""
        return body_named(self.name)

    @property
    def R_fixed_from_eci(self) -> FloatArray:
        """(3, 3) rotation to its axes."""
        return matrix_from_quat(self.q_fixed_from_eci_wxyz)


class BodyStates:
    """Mixin for states of the world: access to their ``bodies`` by name."""

    bodies: tuple[BodyState, ...]
    central_body: str

    def body(self, name: str) -> BodyState:
        """Return the state of a body.

        Returns
        -------
        BodyState
            The first of ``bodies`` with that name.

        Raises
        ------
        KeyError
            If there is none of that name.
        """
        for state in self.bodies:
            if state.name == name:
                return state
        raise KeyError(name)

    @property
    def central(self) -> BodyState:
        """State of the body that the target orbits."""
        return self.body(self.central_body)


def bodies_at(instant: Instant, central: Body) -> tuple[BodyState, ...]:
    """Return the states of Earth and Moon, then of the central body if it is another.

    Positions are apparent, except that of the central body, which is geometric.

    Parameters
    ----------
    instant : Instant
        Time of the states.
    central : Body
        Body that the target orbits.

    Returns
    -------
    tuple of BodyState
        Geocentric positions [m] and orientations.
    """
    return tuple(
        BodyState(
            name=body.name,
            r_eci_m=vec3(body.geocentric_state(instant)[0] if body is central else body.apparent_m(instant)),
            q_fixed_from_eci_wxyz=quat(body.q_fixed_from_eci(instant)),
        )
        for body in dict.fromkeys((*map(body_named, BUILT_IN), central))
    )


def earth_and_moon(
    r_moon_eci_m: Vec3, q_itrs_from_eci_wxyz: Quat = _IDENTITY, q_moon_from_eci_wxyz: Quat = _IDENTITY
) -> tuple[BodyState, BodyState]:
    """Return the states of the Earth and of a Moon at a given position.

    Returns
    -------
    tuple of BodyState
        The Earth, whose centre is the origin, and the Moon; both have the identity as orientation by default.
    """
    return (
        BodyState(name="earth", r_eci_m=(0.0, 0.0, 0.0), q_fixed_from_eci_wxyz=q_itrs_from_eci_wxyz),
        BodyState(name="moon", r_eci_m=r_moon_eci_m, q_fixed_from_eci_wxyz=q_moon_from_eci_wxyz),
    )


def body_names() -> tuple[str, ...]:
    """Return the names of the built-in bodies, then of those from other packages."""
    return (*BUILT_IN, *(name for name in plugins("body") if name not in BUILT_IN))


@cache
def body_named(name: str) -> Body:
    """Return a body by name, importing its module.

    Returns
    -------
    Body
        The object of the module or package itself; the same one at every call.

    Raises
    ------
    UserError
        If there is none, or a package's object of that name is not a body.
    """
    if name in BUILT_IN:
        module, attribute = BUILT_IN[name]
        return getattr(import_module(module), attribute)
    plugin = plugins("body").get(name)
    if plugin is None:
        raise UserError(f"unknown body '{name}'; choose from {', '.join(body_names())}")
    body = plugin.load()
    if not isinstance(body, Body) or body.name != name:
        raise plugin.wrong(f"is not a Body named {name}")
    return body


def R_fixed_from_pole(alpha_deg: float, delta_deg: float, W_deg: float) -> FloatArray:
    """Return the (3, 3) rotation from GCRS to a body's axes, from the angles tabulated by the IAU.

    Parameters
    ----------
    alpha_deg : float
        Right ascension of the pole.
    delta_deg : float
        Declination of the pole.
    W_deg : float
        Angle along the equator from its node on the GCRS equator to longitude 0.

    Raises
    ------
    ValueError
        If an angle is not finite, or the declination not within 90 degrees.

    References
    ----------
    Archinal et al. (2018), Report of the IAU Working Group on Cartographic Coordinates and Rotational Elements: 2015,
    Celest. Mech. Dyn. Astr. 130, figure 1.
    """
    if not (np.isfinite([alpha_deg, W_deg]).all() and -90 <= delta_deg <= 90):
        raise ValueError(
            f"the pole is at {alpha_deg}, {delta_deg} with W = {W_deg} deg: allowed are finite angles, and a "
            "declination of -90 to 90"
        )
    return _rotation_z(W_deg) @ _rotation_x(90.0 - delta_deg) @ _rotation_z(90.0 + alpha_deg)


def q_fixed_from_pole(alpha_deg: float, delta_deg: float, W_deg: float) -> FloatArray:
    """Return `R_fixed_from_pole` as a unit quaternion, scalar first.

    Returns
    -------
    (4,) array
        Quaternion, Hamilton, scalar first.
    """
    return quat_from_matrix(R_fixed_from_pole(alpha_deg, delta_deg, W_deg))


def _rotation_z(angle_deg: float) -> FloatArray:
    """Return the (3, 3) matrix that rotates the axes about z."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def _rotation_x(angle_deg: float) -> FloatArray:
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    return np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
