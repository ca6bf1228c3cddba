"""The accuracy of the world, measured: ``python -m simulator.validation.dynamics`` writes the table.

It compares with the raw outputs of independent programs in ``tests/reference``, so it runs from a checkout.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import erfa
import numpy as np

from simulator.errors import UserError
from simulator.files import write_atomic
from simulator.world.attitude import propagate_attitude
from simulator.world.clohessy_wiltshire import mean_motion_rad_s, transition_matrix
from simulator.world.constants import MU_EARTH_M3_S2
from simulator.world.ephemeris import moon_eci_m, sun_eci_m
from simulator.world.forces import FullForces
from simulator.world.gravity import Gravity
from simulator.world.lvlh import lvlh_frame
from simulator.world.orbit import Elements, propagate, state_from_elements
from simulator.world.rotation import matrix_from_quat
from simulator.world.sky_table import SkyTable
from simulator.world.spherical_harmonics import egm96
from simulator.world.time import Instant
from simulator.world.yamanaka_ankersen import elliptic_transition_matrix

if TYPE_CHECKING:
    from collections.abc import Callable

    from simulator.arrays import FloatArray
    from simulator.world.orbit import OrbitTrack

REFERENCE = Path("tests/reference")
PAGE = Path("docs/validation/dynamics.md")
BASILISK_EPOCH = "2025-03-21T06:00:00Z"
DAY_S = 86_400.0
ORBIT_S = 5_800.0


@dataclass(frozen=True, kw_only=True)
class Row:
    """One line of the table."""

    what: str
    against: str
    unit: str
    goal: float
    measured: float

    @property
    def met(self) -> bool:
        """Whether the goal is reached."""
        return self.measured <= self.goal


def measure(reference: Path) -> list[Row]:
    """All rows.

    Raises
    ------
    UserError
        If the reference outputs are not there.
    """
    return [*against_basilisk(reference), *against_skyfield(reference), *conservation(), *linear_models()]


def against_basilisk(reference: Path) -> list[Row]:
    """A day at 600 km, two craft 10 m apart, EGM96 20x20 + Sun + Moon."""
    table = _read(reference / "basilisk.csv")
    epoch = Instant.from_utc(BASILISK_EPOCH)
    forces = FullForces(sky=SkyTable.of(epoch, DAY_S), harmonics=egm96(20), sun=True, moon=True)
    r, p = table[0, 1:4], table[0, 4:7] - table[0, 1:4]
    v, w = np.array([0.0, -1049.0, 7485.0]), np.array([0.0, -0.013, 0.002])
    track = propagate(r, v, DAY_S, forces, (p, w))
    apart, inertial = [], []
    for t, *both in table:
        theirs, chaser = np.array(both[:3]), np.array(both[3:])
        inertial.append(np.linalg.norm(track(t)[0] - theirs))
        apart.append(np.linalg.norm(track.relative(t)[0] - (chaser - theirs)))
    orbit = table[:, 0] <= ORBIT_S + 300
    name = "Basilisk 2.12.1 (RK4, 1 s)"
    return [
        Row(what="position after a day", against=name, unit="m", goal=1.0, measured=float(max(inertial))),
        Row(
            what="relative position over an orbit",
            against=name,
            unit="m",
            goal=1e-3,
            measured=float(np.max(np.array(apart)[orbit])),
        ),
        Row(
            what="relative position over a day", against=name, unit="m", goal=1e-2, measured=float(max(apart))
        ),
    ]


def against_skyfield(reference: Path) -> list[Row]:
    """Apparent Sun and Moon 2000 to 2050, and the Earth's orientation where UT1 is measured."""
    table = _read(reference / "skyfield.csv")
    jd = table[:, 0]
    turned = []
    for row in table[jd < 2460000.0]:
        t = Instant(float(row[0]), 0.0)
        ours = erfa.c2t06a(t.tt1, t.tt2, *t.ut1, 0.0, 0.0)
        turned.append(_arcsec(ours, row[8:].reshape(3, 3)).max())
    name = "Skyfield 1.55, DE421"
    sun = float(_arcsec(sun_eci_m(jd, 0 * jd), table[:, 2:5]).max())
    moon = float(_arcsec(moon_eci_m(jd, 0 * jd), table[:, 5:8]).max())
    return [
        Row(what="apparent Sun, 2000-2050", against=name, unit="arcsec", goal=1.0, measured=sun),
        Row(what="apparent Moon, 2000-2050", against=name, unit="arcsec", goal=15.0, measured=moon),
        Row(
            what="GCRS to ITRS with UT1, without polar motion",
            against="Skyfield 1.55",
            unit="arcsec",
            goal=0.1,
            measured=float(max(turned)),
        ),
    ]


def conservation() -> list[Row]:
    """Energy and momentum where the model keeps them."""
    r, v = state_from_elements(
        Elements(semi_major_axis_m=6978e3, eccentricity=0.01, inclination_rad=1.7, raan_rad=0.4)
    )
    times = np.linspace(0.0, DAY_S, 200)
    rows = []
    for gravity, name in ((Gravity(j2=0.0), "two-body"), (Gravity(), "two-body + J2")):
        track = propagate(r, v, DAY_S, gravity)
        energy = [float(v @ v) / 2 + gravity.potential(r) for r, v in map(track, times)]
        # about the pole the field is symmetric: that component of the momentum stays in both models
        momentum = [float(np.cross(r, v)[2]) for r, v in map(track, times)]
        for what, values in (("energy", energy), ("axial momentum", momentum)):
            rows.append(
                Row(
                    what=f"{what} over a day, {name}, relative",
                    against="conservation",
                    unit="1",
                    goal=1e-12,
                    measured=float(np.ptp(values) / abs(values[0])),
                )
            )
    J = np.diag([2.5, 2.7, 3.9])
    tumble = propagate_attitude([1, 0, 0, 0], [0.03, -0.02, 0.01], J, DAY_S)
    momenta = np.array(
        [matrix_from_quat(q) @ J @ w for q, w in (tumble(float(t)) for t in np.linspace(0, DAY_S, 100))]
    )
    drift = float(np.max(np.linalg.norm(momenta - momenta[0], axis=1)) / np.linalg.norm(momenta[0]))
    rows.append(
        Row(
            what="momentum of a free tumble over a day, relative",
            against="conservation",
            unit="1",
            goal=1e-12,
            measured=drift,
        )
    )
    return rows


def linear_models() -> list[Row]:
    """How the error of the linear models grows with the distance: its power should be 2."""
    rows = []
    round_earth = Gravity(j2=0.0)
    for name, e in (("Clohessy-Wiltshire, circle", 0.0), ("Yamanaka-Ankersen, e = 0.4", 0.4)):
        orbit = Elements(semi_major_axis_m=7000e3 / (1 - e), eccentricity=e, inclination_rad=1.1)
        span = 4000.0
        n = mean_motion_rad_s(orbit.semi_major_axis_m, MU_EARTH_M3_S2)
        Phi = transition_matrix(n, span) if e == 0 else elliptic_transition_matrix(orbit, span)
        errors = [_linear_error(orbit, round_earth, Phi, scale, span) for scale in (1.0, 2.0)]
        rows.append(
            Row(
                what=f"{name}: power of the error, less 2",
                against="difference of two propagations",
                unit="1",
                goal=0.05,
                measured=abs(float(np.log2(errors[1] / errors[0])) - 2.0),
            )
        )
    return rows


def _linear_error(orbit: Elements, gravity: Gravity, Phi: FloatArray, scale: float, span_s: float) -> float:
    r, v = state_from_elements(orbit)
    start = scale * np.array([60.0, -80.0, 40.0, 0.01, -0.05, 0.02])
    frame = lvlh_frame(r, v, gravity.acceleration(r))
    track: OrbitTrack = propagate(r, v, span_s, gravity, frame.to_eci(start[:3], start[3:]))
    then = lvlh_frame(*track(span_s), track.acceleration(span_s))
    p, _ = then.from_eci(*track.relative(span_s))
    return float(np.linalg.norm((Phi @ start)[:3] - p))


def page(rows: list[Row]) -> str:
    """The table as a page."""
    lines = [
        "# Accuracy of the world",
        "",
        "Made by `python -m simulator.validation.dynamics` from the raw outputs of independent programs in",
        "`tests/reference` (their generators lie beside them) and from what physics conserves.",
        "",
        "| quantity | against | goal | measured | |",
        "|---|---|---|---|---|",
    ]
    for row in rows:
        unit = "" if row.unit == "1" else f" {row.unit}"
        verdict = "met" if row.met else "**missed**"
        lines.append(
            f"| {row.what} | {row.against} | {row.goal:g}{unit} | {row.measured:.2g}{unit} | {verdict} |"
        )
    lines += [
        "",
        "Basilisk was handed our EGM96 coefficients, Earth orientation and geometric Sun and Moon by message and",
        "integrated with its own force models: the comparison proves the equations and the integration, not the",
        "ephemeris; that is what the rows against Skyfield do. Drag and sunlight are tested against their formulas",
        "only. Skyfield's row leaves polar motion (up to 0.6 arcsec) out on both sides.",
    ]
    return "\n".join(lines) + "\n"


def main(arguments: list[str] | None = None, say: Callable[[str], None] = print) -> int:
    """Measure, print and write the page; 0 when every goal is met."""
    parser = argparse.ArgumentParser(description="Measure the accuracy of the world.")
    parser.add_argument("--reference", type=Path, default=REFERENCE, help="folder of the reference outputs")
    parser.add_argument("-o", "--output", type=Path, default=PAGE, help="page to write")
    options = parser.parse_args(arguments)
    rows = measure(options.reference)
    text = page(rows)
    write_atomic(options.output, text.encode())
    say(text)
    return 0 if all(row.met for row in rows) else 1


def _arcsec(a: FloatArray, b: FloatArray) -> FloatArray:
    sine = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.asarray(np.degrees(np.arctan2(sine, np.sum(a * b, axis=-1))) * 3600)


def _read(path: Path) -> FloatArray:
    if not path.is_file():
        raise UserError(
            f"there is no reference output {path}: run from the root of a checkout, or name --reference"
        )
    return np.genfromtxt(path, delimiter=",", skip_header=1)


if __name__ == "__main__":
    raise SystemExit(main())
