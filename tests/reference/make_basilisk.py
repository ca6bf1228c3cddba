"""Makes basilisk.csv: a day of two spacecraft 10 m apart, flown by the independent propagator Basilisk.

Basilisk (PyPI ``bsk`` 2.12.1) integrates with its own Runge-Kutta 4 at 1 s and its own spherical harmonics. It
is handed the same EGM96 coefficients, Earth orientation and geometric Sun and Moon, by message. Run in an
environment that has bsk, pyerfa and scipy, from the repository's root: ``python tests/reference/make_basilisk.py``.
"""

import csv
import sys
import tempfile
from pathlib import Path

import numpy as np
from Basilisk.architecture import messaging, sysModel
from Basilisk.simulation import spacecraft
from Basilisk.utilities import SimulationBaseClass, macros, simIncludeGravBody

sys.path.insert(0, str(Path(__file__).parents[2]))
from flyaround.simulator.world.constants import MU_MOON_M3_S2, MU_SUN_M3_S2
from flyaround.simulator.world.ephemeris.earth_orientation import R_itrs_from_eci
from flyaround.simulator.world.ephemeris.sun_moon import moon_geometric_m, sun_geometric_m
from flyaround.simulator.world.time.instant import Instant

EPOCH = "2025-03-21T06:00:00Z"
R0_M = (6_978_137.0, 0.0, 0.0)
V0_M_S = (0.0, -1_049.0, 7_485.0)
APART_M = (6.0, -8.0, 0.0)
APART_M_S = (0.0, -0.013, 0.002)
DEGREE = 20
STEP_S, EVERY_S, SPAN_S = 1.0, 600.0, 86_400.0


class Sky(sysModel.SysModel):
    """Publishes Earth orientation, Sun and Moon at every step."""

    def __init__(self):
        super().__init__()
        self.epoch = Instant.from_utc(EPOCH)
        self.messages = {n: messaging.SpicePlanetStateMsg() for n in ("earth", "sun", "moon")}

    def Reset(self, now_ns):
        self.UpdateState(now_ns)

    def UpdateState(self, now_ns):
        # what is published now serves the step that ends now, so it is given for the middle of that step
        t = self.epoch.plus(now_ns * 1e-9 - STEP_S / 2)
        for name, message in self.messages.items():
            payload = messaging.SpicePlanetStateMsgPayload()
            payload.PlanetName = name
            if name == "earth":
                payload.J20002Pfix = R_itrs_from_eci(t).tolist()
                payload.computeOrient = 1
            else:
                where = sun_geometric_m if name == "sun" else moon_geometric_m
                payload.PositionVector = where(t.tt1, t.tt2).tolist()
                payload.J20002Pfix = np.eye(3).tolist()
            message.write(payload, now_ns, self.moduleID)


def coefficients(folder):
    """The shipped EGM96 file in the layout Basilisk reads."""
    text = (Path(__file__).parents[2] / "assets" / "gravity" / "EGM96_to70.gfc").read_text()
    terms = {(int(w[1]), int(w[2])): w[3:5] for w in map(str.split, text.splitlines()) if w[:1] == ["gfc"]}
    rows = [["6378136.3", "3.986004415e14", "0", "70", "70", "1", "0", "0"]]
    for n in range(DEGREE + 1):
        rows += [[str(n), str(m), *terms.get((n, m), ("0", "0")), "0", "0"] for m in range(n + 1)]
    out = folder / "egm96.csv"
    with out.open("w", newline="") as file:
        csv.writer(file).writerows(rows)
    return out


def main():
    """Fly and write."""
    simulation = SimulationBaseClass.SimBaseClass()
    process = simulation.CreateNewProcess("p")
    process.addTask(simulation.CreateNewTask("t", macros.sec2nano(STEP_S)))
    sky = Sky()
    sky.ModelTag = "sky"
    simulation.AddModelToTask("t", sky, 100)
    factory = simIncludeGravBody.gravBodyFactory()
    earth, sun, moon = factory.createEarth(), factory.createSun(), factory.createMoon()
    earth.isCentralBody = True
    earth.useSphericalHarmonicsGravityModel(str(coefficients(Path(tempfile.mkdtemp()))), DEGREE)
    earth.mu, earth.radEquator = 3.986004415e14, 6_378_136.3  # its own default is another model's
    sun.mu, moon.mu = MU_SUN_M3_S2, MU_MOON_M3_S2
    for name, body in (("earth", earth), ("sun", sun), ("moon", moon)):
        body.planetBodyInMsg.subscribeTo(sky.messages[name])
    logs = []
    for k in range(2):
        craft = spacecraft.Spacecraft()
        craft.ModelTag = f"craft{k}"
        craft.hub.mHub = 100.0
        craft.hub.r_CN_NInit = (np.array(R0_M) + k * np.array(APART_M)).tolist()
        craft.hub.v_CN_NInit = (np.array(V0_M_S) + k * np.array(APART_M_S)).tolist()
        factory.addBodiesTo(craft)
        simulation.AddModelToTask("t", craft, 1)
        logs.append(craft.scStateOutMsg.recorder(macros.sec2nano(EVERY_S)))
        simulation.AddModelToTask("t", logs[-1], 0)
    simulation.InitializeSimulation()
    simulation.ConfigureStopTime(macros.sec2nano(SPAN_S))
    simulation.ExecuteSimulation()
    with (Path(__file__).parent / "basilisk.csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["t_s", "x_m", "y_m", "z_m", "chaser_x_m", "chaser_y_m", "chaser_z_m"])
        for t, a, b in zip(logs[0].times(), logs[0].r_CN_N, logs[1].r_CN_N, strict=True):
            writer.writerow([t * 1e-9, *(f"{x:.9f}" for x in (*a, *b))])


if __name__ == "__main__":
    main()
