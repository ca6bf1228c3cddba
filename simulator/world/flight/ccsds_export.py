"""A flight as CCSDS messages: orbit and attitude of target and chaser."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from simulator.world.frames.rotation import quat_conjugate
from simulator.world.messages.aem import write_aem
from simulator.world.messages.oem import write_oem

if TYPE_CHECKING:
    from collections.abc import Iterable

    from simulator.world.flight.flight import Flight


def flight_messages(
    flight: Flight, times_s: Iterable[float], *, oem: bool = True, aem: bool = True
) -> dict[str, str]:
    """File names and texts of the messages asked for.

    Orbits are those of the centres of mass; the target's body frame is its model's, the chaser's its camera's.
    """
    times = [float(t) for t in times_s]
    states = [flight.state(t) for t in times]
    epochs = [s.epoch_utc for s in states]
    files = {}
    if oem:
        about_the_body = np.array([np.concatenate(flight.orbit(t)) for t in times])
        apart = np.array([(*s.relative_eci_m, *s.relative_eci_m_s) for s in states])
        for name, rows in (("target", about_the_body), ("chaser", about_the_body + apart)):
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
