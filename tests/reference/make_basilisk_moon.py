"""Makes basilisk_moon.csv: a day of two spacecraft 10 m apart about the Moon, flown by Basilisk.

Basilisk (PyPI ``bsk`` 2.12.1) integrates with its own Runge-Kutta 4 at 1 s; the Earth and the Sun pull as third
bodies, their places handed to it by message. Run in an environment that has bsk, pyerfa and scipy, from the
repository's root: ``python tests/reference/make_basilisk_moon.py``.
"""

import csv
import sys
from pathlib import Path

import numpy as np
from Basilisk.architecture import messaging, sysModel
from Basilisk.simulation import spacecraft
from Basilisk.utilities import SimulationBaseClass, macros, simIncludeGravBody

sys.path.insert(0, str(Path(__file__).parents[2]))
from flyaround.simulator.world.constants import MU_EARTH_M3_S2, MU_MOON_M3_S2, MU_SUN_M3_S2
from flyaround.simulator.world.ephemeris.sun_moon import moon_geometric_m, sun_geometric_m
from flyaround.simulator.world.time.instant import Instant

EPOCH = "2024-06-06T05:00:00Z"
R0_M = (1_937_400.0, 0.0, 0.0)
V0_M_S = (0.0, -1_160.0, 1_090.0)
APART_M = (6.0, -8.0, 0.0)
APART_M_S = (0.0, -0.005, 0.002)
STEP_S, EVERY_S, SPAN_S = 1.0, 1200.0, 86_400.0


class Sky(sysModel.SysModel):
    """Publishes Earth and Sun, seen from the Moon, at every step."""

    def __init__(self):
        super().__init__()
        self.epoch = Instant.from_utc(EPOCH)
        self.messages = {n: messaging.SpicePlanetStateMsg() for n in ("moon", "earth", "sun")}

    def Reset(self, now_ns):
        self.UpdateState(now_ns)

    def UpdateState(self, now_ns):
        # what is published now serves the step that ends now, so it is given for the middle of that step
        t = self.epoch.plus(now_ns * 1e-9 - STEP_S / 2)
        moon = moon_geometric_m(t.tt1, t.tt2)
        places = {"moon": np.zeros(3), "earth": -moon, "sun": sun_geometric_m(t.tt1, t.tt2) - moon}
        for name, message in self.messages.items():
            payload = messaging.SpicePlanetStateMsgPayload()
            payload.PlanetName = name
            payload.PositionVector = places[name].tolist()
            payload.J20002Pfix = np.eye(3).tolist()
            message.write(payload, now_ns, self.moduleID)


def main():
    """Fly and write."""
    simulation = SimulationBaseClass.SimBaseClass()
    process = simulation.CreateNewProcess("p")
    process.addTask(simulation.CreateNewTask("t", macros.sec2nano(STEP_S)))
    sky = Sky()
    sky.ModelTag = "sky"
    simulation.AddModelToTask("t", sky, 100)
    factory = simIncludeGravBody.gravBodyFactory()
    moon, earth, sun = factory.createMoon(), factory.createEarth(), factory.createSun()
    moon.isCentralBody = True
    moon.mu, earth.mu, sun.mu = MU_MOON_M3_S2, MU_EARTH_M3_S2, MU_SUN_M3_S2
    for name, body in (("moon", moon), ("earth", earth), ("sun", sun)):
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
    with (Path(__file__).parent / "basilisk_moon.csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["t_s", "x_m", "y_m", "z_m", "chaser_x_m", "chaser_y_m", "chaser_z_m"])
        for t, a, b in zip(logs[0].times(), logs[0].r_CN_N, logs[1].r_CN_N, strict=True):
            writer.writerow([t * 1e-9, *(f"{x:.9f}" for x in (*a, *b))])


if __name__ == "__main__":
    main()
