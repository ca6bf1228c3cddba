"""Cost of the parts: the world's step, a captured frame with its labels, a sensor's image."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from flyaround.simulator.camera.detector.image_noise import start_noise
from flyaround.simulator.camera.detector.presets import list_sensor_presets, sensor_preset
from flyaround.simulator.dataset.capture import capture
from flyaround.simulator.imaging.image_formation import digitise, expose
from flyaround.simulator.runtime.arrays import FloatArray
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.world.attitude.pointing import Pointing
from flyaround.simulator.world.attitude.rigid_body import propagate_attitude
from flyaround.simulator.world.constants import DAY_S, EARTH_RADIUS_M
from flyaround.simulator.world.ephemeris.ephemeris_table import EphemerisTable
from flyaround.simulator.world.guidance.paths import Hold
from flyaround.simulator.world.guidance.thruster_control import fly_controlled
from flyaround.simulator.world.guidance.thrusters import Thrusters
from flyaround.simulator.world.orbit.forces import EarthForces, Forces
from flyaround.simulator.world.orbit.propagation import Elements, propagate, state_from_elements
from flyaround.simulator.world.orbit.spherical_harmonics import egm96
from flyaround.simulator.world.relative.clohessy_wiltshire import mean_motion_rad_s
from flyaround.simulator.world.time.instant import Instant

SCENARIO = "tango-flyaround"

# Number of propagated states, and of captured frames: more repeat better, and take longer.
N_STATES = 200
N_CAPTURED = 4

# Number and length of the orbit's steps [s].
N_STEPS = 100
STEP_S = 0.1

# Shape of the sensor's image: rows, columns.
PICTURE_SHAPE = (1200, 1920)

# Exposure time of the sensor bench [s].
EXPOSURE_S = 1e-3

# Number of timed images, and of images before them that are not timed.
SENSOR_LAPS, SENSOR_WARM_UP = 12, 2
AHEAD_S = 0.03  # time from the submission of a frame's commands to its read-back


@dataclass(frozen=True, kw_only=True)
class PartCost:
    """Cost of one operation of a part [ms], and the peak memory of a process that does nothing else [MB].

    Parameters
    ----------
    name : str
        Name of the operation.
    ms_p50 : float
        Median duration.
    ms_p95 : float
        95th percentile of the duration.
    peak_mb : float, optional
        Peak memory of the process [10^6 bytes]; None if it was not measured.
    kernels : str, optional
        Implementation of an estimator's inner loops; None for other parts.
    """

    name: str
    ms_p50: float
    ms_p95: float
    peak_mb: float | None = None
    kernels: str | None = None


def cost(name: str, laps_ms: list[float], *, peak_mb: float | None = None) -> PartCost:
    """Summarise the measured laps of an operation.

    Returns
    -------
    PartCost
        Median and 95th percentile of the laps [ms], with the given peak memory.
    """
    return PartCost(
        name=name,
        ms_p50=float(np.percentile(laps_ms, 50)),
        ms_p95=float(np.percentile(laps_ms, 95)),
        peak_mb=peak_mb,
    )


def bench_world() -> tuple[PartCost, ...]:
    """Time the propagation of a flight, its scenes and its control.

    Returns
    -------
    tuple of PartCost
        Plan of a minute's flight, one scene of it, a day of both craft with all perturbations, and one control step.
    """
    laps = []
    for _ in range(5):
        start = time.perf_counter()
        plan = plan_flight(load_scenario(SCENARIO), n=N_STATES)
        laps.append((time.perf_counter() - start) * 1e3)
    scenes = []
    for k in range(N_STATES):
        start = time.perf_counter()
        plan.scene(k)
        scenes.append((time.perf_counter() - start) * 1e3)
    return (
        cost("propagate a minute", laps),
        cost("state and scene of one frame", scenes),
        cost("a day at 600 km of both craft, EGM96 20x20 + Sun + Moon", _day_laps()),
        cost("control step of both craft, EGM96 8x8 + Sun + Moon", _step_laps()),
    )


def _start(degree: int, duration_s: float) -> tuple[FloatArray, FloatArray, EarthForces]:
    r, v = state_from_elements(Elements(semi_major_axis_m=EARTH_RADIUS_M + 600e3, inclination_rad=1.7))
    sky = EphemerisTable.build(Instant.from_utc("2025-03-21T06:00:00Z"), duration_s)
    return r, v, EarthForces(sky=sky, harmonics=egm96(degree), forces=Forces(sun=True, moon=True))


def _day_laps() -> list[float]:
    r, v, forces = _start(20, DAY_S)
    start = time.perf_counter()
    propagate(r, v, DAY_S, forces, (np.array([0.0, 10.0, 0.0]), np.zeros(3)))
    return [(time.perf_counter() - start) * 1e3]


def _step_laps() -> list[float]:
    """Time both orbits, guidance, control, thrusters and both attitudes over one period of 0.1 s."""
    r, v, forces = _start(8, N_STEPS * STEP_S)
    hold = Hold(position_lvlh_m=(0.0, -10.0, 0.0))
    n = mean_motion_rad_s(float(np.linalg.norm(r)), forces.mu_m3_s2)
    inertia = np.diag([2.5, 2.7, 3.9])
    pointing = Pointing()
    laps = []
    for _ in range(5):
        start = time.perf_counter()
        orbit = propagate(r, v, N_STEPS * STEP_S, forces)
        tumble = propagate_attitude([1, 0, 0, 0], [0.02, -0.03, 0.01], inertia, N_STEPS * STEP_S)
        track = fly_controlled(orbit, hold, n, Thrusters(period_s=STEP_S))
        for k in range(N_STEPS):
            p, w = track.position_eci_m[k], track.velocity_eci_m_s[k]
            t = k * STEP_S
            pointing.attitude(-p, -w, orbit.frame(t))
            tumble(t)
        laps.append((time.perf_counter() - start) * 1e3 / N_STEPS)
    return laps


def bench_capture() -> tuple[PartCost, ...]:
    """Time a frame with all labels, verified and written.

    Returns
    -------
    tuple of PartCost
        One cost: that of a frame, from the second frame on.
    """
    laps: list[float] = []
    last = 0.0

    def lap(done: int, _of: int) -> None:
        nonlocal last
        now = time.perf_counter()
        if done > 1:
            laps.append((now - last) * 1e3)
        last = now

    with TemporaryDirectory() as folder:
        plan = plan_flight(load_scenario(SCENARIO), n=N_CAPTURED)
        capture(plan, Path(folder) / "set", progress=lap)
    return (cost("labelled frame, checked and written", laps),)


def bench_sensor() -> tuple[PartCost, ...]:
    """Time blur, noise and quantisation of a 1920 x 1200 image for each built-in sensor.

    The image is one third dark sky, one third uniform grey, and one third a ramp beyond saturation. As in a frame, the
    noise has been drawn beforehand.

    Returns
    -------
    tuple of PartCost
        Cost of each sensor in the order of `list_sensor_presets`, without the warm-up.
    """
    picture = np.zeros(PICTURE_SHAPE, np.float32)
    third = PICTURE_SHAPE[0] // 3
    costs = []
    for name in list_sensor_presets():
        sensor = sensor_preset(name)
        unit = float(expose(np.ones((1, 1), np.float32), sensor, EXPOSURE_S)[0, 0])
        picture[third : 2 * third] = 0.5 / unit
        picture[2 * third :] = np.linspace(0, 1.2 / unit, PICTURE_SHAPE[1], dtype=np.float32)
        laps = []
        for k in range(SENSOR_LAPS + SENSOR_WARM_UP):
            noise = start_noise(PICTURE_SHAPE, sensor, 1, k)
            time.sleep(AHEAD_S)
            start = time.perf_counter()
            digitise(expose(picture, sensor, EXPOSURE_S), sensor, 1, k, EXPOSURE_S, noise=noise)
            laps.append((time.perf_counter() - start) * 1e3)
        costs.append(cost(f"{name}, 1920 x 1200", laps[SENSOR_WARM_UP:]))
    return tuple(costs)
