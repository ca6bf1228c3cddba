"""Where a chaser would drift without thrust: the Yamanaka-Ankersen equations from its state of the moment."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from simulator.world.orbit.propagation import elements_from_state
from simulator.world.relative.yamanaka_ankersen import elliptic_transition_matrix

if TYPE_CHECKING:
    from simulator.runtime.arrays import FloatArray
    from simulator.world.guidance.manual_control import ChaserState
    from simulator.world.orbit.propagation import OrbitTrack


def predicted_drift_lvlh_m(
    orbit: OrbitTrack, chaser: ChaserState, horizon_s: float, samples: int = 25
) -> FloatArray:
    """Free flight over a horizon, on any bound orbit, to first order in the distance: (samples, 3) LVLH [m].

    Parameters
    ----------
    orbit : of the target. chaser : its state now. horizon_s : how far ahead. samples : from now to then.
    """
    mu = orbit.forces.mu_m3_s2
    elements = elements_from_state(*orbit(chaser.t_s), mu)
    frame = orbit.frame(chaser.t_s)
    state = np.concatenate(frame.from_eci(np.array(chaser.position_eci_m), np.array(chaser.velocity_eci_m_s)))
    times = np.linspace(0.0, horizon_s, samples)
    return np.array([(elliptic_transition_matrix(elements, float(t), mu) @ state)[:3] for t in times])
