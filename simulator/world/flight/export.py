"""Export of a flight: rows of a table, a summary, and CCSDS messages of orbit and attitude."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.world.flight.log import FlightLog
from flyaround.simulator.world.frames.rotation import quat_conjugate
from flyaround.simulator.world.messages.aem import write_aem
from flyaround.simulator.world.messages.oem import write_oem

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from flyaround.simulator.world.flight.flight import Flight


_VECTORS = (
    "r_target_eci_m",
    "v_target_eci_m_s",
    "r_chaser_eci_m",
    "v_chaser_eci_m_s",
    "position_lvlh_m",
    "velocity_lvlh_m_s",
    "omega_target_rad_s",
    "omega_camera_rad_s",
)
_QUATERNIONS = ("q_eci_from_target_wxyz", "q_camera_from_eci_wxyz")


Row = dict[str, str | float | None]


def fly_table(flight: Flight, times_s: Iterable[float]) -> list[Row]:
    """Return the states of a flight as rows of a table.

    Returns
    -------
    list of Row
        One row for each time, in the order of ``times_s``; all have the same columns in the same order. A vector
        ``r_target_eci_m`` becomes the columns ``r_target_eci_x_m``, ``_y_m`` and ``_z_m``. After the states follow
        the chaser's phase, thrust, mass, accumulated delta-v, and the events since the previous row, separated by
        semicolons. Unknown values are None.
    """
    rows: list[Row] = []
    for t in times_s:
        state = flight.state(float(t))
        row: Row = {"epoch_utc": state.epoch_utc, "t_s": state.t_s}
        for name in _VECTORS:
            quantity, unit = _split_unit(name)
            row |= {
                f"{quantity}_{axis}_{unit}": x for axis, x in zip("xyz", getattr(state, name), strict=True)
            }
        quaternions = {name: getattr(state, name) for name in _QUATERNIONS}
        quaternions["q_itrs_from_eci_wxyz"] = state.body("earth").q_fixed_from_eci_wxyz
        for name, values in quaternions.items():
            quantity = name.removesuffix("_wxyz")
            row |= {f"{quantity}_{axis}": x for axis, x in zip("wxyz", values, strict=True)}
        row |= {"range_m": state.range_m, "sun_visible_fraction": state.sun_visible_fraction}
        rows.append(row)
    return _with_log(flight, rows)


def _with_log(flight: Flight, rows: list[Row]) -> list[Row]:
    """Return the rows with phases, thrust and events of the flight's log."""
    log = FlightLog(flight)
    times = [float(row["t_s"] or 0.0) for row in rows]
    events = log.events(times, [float(row["sun_visible_fraction"] or 0.0) for row in rows])
    for k, (t, row) in enumerate(zip(times, rows, strict=True)):
        thrust = log.thrust_state(t)
        a, mass = thrust.acceleration_lvlh_m_s2, thrust.mass_kg
        row["phase"] = thrust.phase
        for i, axis in enumerate("xyz"):
            row[f"thrust_acceleration_lvlh_{axis}_m_s2"] = None if a is None else a[i]
        for i, axis in enumerate("xyz"):
            row[f"thrust_lvlh_{axis}_n"] = None if a is None or mass is None else a[i] * mass
        row["mass_kg"], row["delta_v_m_s"] = mass, thrust.delta_v_m_s
        previous_s = -np.inf if k == 0 else times[k - 1]
        row["events"] = "; ".join(e.what for e in events if previous_s < e.t_s <= t)
    return rows


def summarise_flight(flight: Flight, rows: Sequence[Row]) -> dict[str, Any]:
    """Summarise a flight as a document for JSON.

    Parameters
    ----------
    flight : Flight
        The flight.
    rows : sequence of Row
        Rows of `fly_table`, whose spacing is the resolution of phases and of the closest approach.

    Returns
    -------
    dict
        ``rows``; ``aborted``, ``abort_s``; ``phases`` [{``phase from_s to_s``}]; ``delta_v_m_s``, ``propellant_kg``,
        ``mass_kg`` [at the start, at the end], each None if unknown; ``min_range_m`` at ``min_range_s``;
        ``events`` [{``t_s kind what``}].
    """
    log = FlightLog(flight)
    times, ranges, sun = (
        [float(row[name] or 0.0) for row in rows] for name in ("t_s", "range_m", "sun_visible_fraction")
    )
    nearest = int(np.argmin(ranges))
    track = flight.controlled
    abort_s = None if track is None else track.abort_s
    return {
        "rows": len(rows),
        "aborted": abort_s is not None,
        "abort_s": abort_s,
        "phases": _phases(rows, times),
        "delta_v_m_s": log.delta_v_m_s,
        "propellant_kg": log.propellant_kg,
        "mass_kg": None if track is None else [float(track.mass_kg[0]), track.end_mass_kg],
        "min_range_m": ranges[nearest],
        "min_range_s": times[nearest],
        "events": [{"t_s": e.t_s, "kind": e.kind, "what": e.what} for e in log.events(times, sun)],
    }


def _phases(rows: Sequence[Row], times_s: Sequence[float]) -> list[dict[str, Any]]:
    """Group consecutive rows with the same phase; each phase ends where the next one starts."""
    starts = [k for k, row in enumerate(rows) if k == 0 or row["phase"] != rows[k - 1]["phase"]]
    ends = [*starts[1:], len(rows) - 1]
    return [
        {"phase": rows[k]["phase"], "from_s": times_s[k], "to_s": times_s[end]}
        for k, end in zip(starts, ends, strict=True)
    ]


def _split_unit(name: str) -> tuple[str, str]:
    """Split a name such as ``v_target_eci_m_s`` into quantity and unit."""
    unit = next(u for u in ("rad_s", "m_s", "m") if name.endswith(f"_{u}"))
    return name.removesuffix(f"_{unit}"), unit


def flight_messages(
    flight: Flight, times_s: Iterable[float], *, oem: bool = True, aem: bool = True
) -> dict[str, str]:
    """Return CCSDS messages of both craft by file name, ready to be written.

    Orbits are those of the centres of mass. Attitudes are those of the target's model frame and the camera frame.

    Parameters
    ----------
    flight : Flight
        Flight to export.
    times_s : iterable of float
        Times of the lines since the start [s].
    oem : bool, optional
        True for orbit messages.
    aem : bool, optional
        True for attitude messages.

    Returns
    -------
    dict
        Text by file name.
    """
    # rounded to the microseconds of the time stamps, because a craft moves by millimetres in half of one
    times = [round(float(t), 6) for t in times_s]
    states = [flight.state(t) for t in times]
    epochs = [s.epoch_utc for s in states]
    files = {}
    if oem:
        target_states = np.array([np.concatenate(flight.orbit(t)) for t in times])
        relative_states = np.array([(*s.relative_eci_m, *s.relative_eci_m_s) for s in states])
        for name, rows in (("target", target_states), ("chaser", target_states + relative_states)):
            files[f"{name}.oem"] = write_oem(
                name=name.upper(),
                centre=flight.body.name.upper(),
                epochs_utc=epochs,
                r_eci_m=rows[:, :3],
                v_eci_m_s=rows[:, 3:],
                note="centre of mass",
            )
    if aem:
        attitudes = {
            "target": ("TARGET_MODEL", np.array([s.q_eci_from_target_wxyz for s in states])),
            "chaser": ("CAMERA_1", quat_conjugate([s.q_camera_from_eci_wxyz for s in states])),
        }
        for name, (body, q) in attitudes.items():
            files[f"{name}.aem"] = write_aem(
                name=name.upper(), body_frame=body, epochs_utc=epochs, q_eci_from_body_wxyz=q
            )
    return files
