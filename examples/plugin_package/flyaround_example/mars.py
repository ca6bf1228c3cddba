"""Mars: a sphere of one albedo under thin air."""

from dataclasses import dataclass

import erfa
import numpy as np

from flyaround.plugins import Body, BodyAir, Instant, q_fixed_from_pole, sun_geometric_m

AU_M, DAY_S = 149_597_870_700.0, 86_400.0


@dataclass(frozen=True, kw_only=True)
class Mars(Body):
    """The fourth planet, by SOFA's series (some 30 arcsec from the Sun) and the elements of the IAU."""

    def geocentric_state(self, now: Instant) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m s-1] from the Earth's centre, GCRS axes."""
        mars = erfa.plan94(now.tt1, now.tt2, 4)
        earth, _ = erfa.epv00(now.tt1, now.tt2)
        position = sun_geometric_m(now.tt1, now.tt2) + mars["p"] * AU_M
        return position, (mars["v"] - earth["v"]) * AU_M / DAY_S

    def q_fixed_from_eci(self, now: Instant) -> np.ndarray:
        """Return the orientation: Archinal et al. (2011), IAU Working Group on Cartographic Coordinates, table 1."""
        days = now.tt1 - 2_451_545.0 + now.tt2
        centuries = days / 36_525.0
        return q_fixed_from_pole(
            317.68143 - 0.1061 * centuries, 52.88650 - 0.0609 * centuries, 176.630 + 350.89198226 * days
        )


MARS = Mars(
    name="mars",
    title="Mars",
    mu_m3_s2=4.2828375e13,  # JPL DE430
    radius_m=3_389_500.0,
    mean_radius_m=3_389_500.0,
    turn_rad_s=7.088218e-5,
    lowest_m=90e3,
    reach_m=5.77e8,
    albedo=0.25,  # Bond
    sun_distance_m=1.5237 * AU_M,
    # 610 Pa of CO2 at 210 K, which scatters 2.4 times as much per molecule as the Earth's air; no dust
    air=BodyAir(rayleigh_m_um4=2.45e-8, rayleigh_height_m=11_100.0, thickness_m=80_000.0),
)
