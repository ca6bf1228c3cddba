"""A flight as rows of a table."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from simulator.world.flight import Flight

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
_QUATERNIONS = ("q_eci_from_target_wxyz", "q_camera_from_eci_wxyz", "q_itrs_from_eci_wxyz")


def fly_table(flight: Flight, times_s: Iterable[float]) -> list[dict[str, str | float]]:
    """States as rows for a table; a vector ``r_target_eci_m`` becomes ``r_target_eci_x_m`` and so on."""
    rows = []
    for t in times_s:
        state = flight.state(float(t))
        row: dict[str, str | float] = {"epoch_utc": state.epoch_utc, "t_s": state.t_s}
        for name in _VECTORS:
            quantity, unit = _split_unit(name)
            row |= {
                f"{quantity}_{axis}_{unit}": x for axis, x in zip("xyz", getattr(state, name), strict=True)
            }
        for name in _QUATERNIONS:
            quantity = name.removesuffix("_wxyz")
            row |= {f"{quantity}_{axis}": x for axis, x in zip("wxyz", getattr(state, name), strict=True)}
        row |= {"range_m": state.range_m, "sun_visible_fraction": state.sun_visible_fraction}
        rows.append(row)
    return rows


def _split_unit(name: str) -> tuple[str, str]:
    """``v_target_eci_m_s`` as quantity and unit."""
    unit = next(u for u in ("rad_s", "m_s", "m") if name.endswith(f"_{u}"))
    return name.removesuffix(f"_{unit}"), unit
