"""Time per frame of every built-in scenario through every built-in camera, monochrome and RGB."""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from flyaround.simulator.bench.scenes import BenchMachine, bench_machine, labels_cost
from flyaround.simulator.camera.detector.presets import list_sensor_presets
from flyaround.simulator.camera.lens.files import list_cameras, load_camera
from flyaround.simulator.dataset.capture import capture
from flyaround.simulator.errors import UserError
from flyaround.simulator.frame import take_frame
from flyaround.simulator.render.reference_pass import ReferencePass
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.scenario.load import list_scenarios, load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.guidance.paths import Hold

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from flyaround.simulator.scenario.plan import Plan
    from flyaround.simulator.scenario.scenario import Scenario
    from flyaround.simulator.scene.illumination.bands import Bands

FRAMES = 5  # timed frames per combination
WARM_UP = 2  # untimed frames before them
STEP_S = 0.05  # time between consecutive frames, which all differ
BASE, CLOSE = "tango-earth-10m", "tango-close-3m"
PINHOLE, LENS = "speed", "speedplus"
FISHEYE, PINHOLE_OF_ITS_SIZE = "fisheye-140", "paper"
LARGE_TARGET = "tianzhou"  # 111,000 triangles
BIT_DEPTHS = (10, 12, 16)  # bits of the detector in the variants
_BANDS: tuple[Bands, ...] = ("mono", "rgb")


@dataclass(frozen=True, kw_only=True)
class CombinationCost:
    """Median times of one combination [ms per frame], without the start-up of processes.

    Parameters
    ----------
    scenario : str
        Name of the scenario.
    camera : str
        Name of the camera.
    bands : str
        ``mono`` or ``rgb``.
    variant : str
        Difference from the scenario besides the camera: ``sensor NAME``, ``bits N``, ``target NAME``; empty for none.
    width_px : int
        Image width.
    height_px : int
        Image height.
    frame_ms : float
        Render, read-back and sensor; no labels.
    render_ms : float
        Time to render.
    sensor_ms : float
        Time of the sensor model.
    labels_ms : float
        Additional time for truth, mask and all layers.
    capture_ms : float
        A frame with truth and mask, checked and written.
    reference_ms : float
        The reference pass at this size, alternating with the frames.
    """

    scenario: str
    camera: str
    bands: str
    variant: str
    width_px: int
    height_px: int
    frame_ms: float
    render_ms: float
    sensor_ms: float
    labels_ms: float
    capture_ms: float
    reference_ms: float


@dataclass(frozen=True, kw_only=True)
class Goal:
    """A measured ratio or time and its limit."""

    name: str
    measured: float
    limit: float
    unit: str
    worst: str

    @property
    def met(self) -> bool:
        """True if the limit is met."""
        return self.measured <= self.limit


@dataclass(frozen=True)
class _Combination:
    scenario: str
    camera: str
    bands: Bands
    variant: str = ""


def bench_combinations(
    scenarios: tuple[str, ...] = (),
    *,
    n_frames: int = FRAMES,
    device_index: int | None = None,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> tuple[BenchMachine, tuple[CombinationCost, ...]]:
    """Time every scenario (or the given ones) x camera x bands, and variants of the base scenario.

    Raises
    ------
    UserError
        If a scenario is not a built-in one.
    """
    for name in scenarios:
        if name not in list_scenarios():
            raise UserError(
                f"unknown scenario '{name}' in --scene; with --all choose from {', '.join(list_scenarios())}"
            )
    combinations = tuple(_combinations(scenarios or list_scenarios()))
    costs = []
    with ExitStack() as stack:
        reference = stack.enter_context(ReferencePass(device_index=device_index))
        renderer = stack.enter_context(Renderer(device_index=device_index))
        plans: dict[str, Plan] = {}
        for done, combination in enumerate(combinations):
            plan = _plan(combination, plans, n_frames)
            costs.append(_cost(renderer, reference, combination, plan, n_frames, device_index))
            progress(done + 1, len(combinations))
        machine = bench_machine(renderer)
    return machine, tuple(costs)


def goals_of(costs: tuple[CombinationCost, ...]) -> tuple[Goal, ...]:
    """Return the goals whose combinations were timed, each at its worst combination of this run."""
    by_key = {(c.scenario, c.camera, c.bands, c.variant): c for c in costs}
    base = by_key.get((BASE, PINHOLE, "mono", ""))
    if base is None:
        return ()

    def ratios(
        name: str,
        limit: float,
        is_selected: Callable[[CombinationCost], bool],
        quantity: str = "frame_ms",
        **conditions: str,
    ) -> Iterator[Goal]:
        """Return the worst ratio of a selected combination to the one that differs from it by ``beside``."""
        measured = []
        for c in costs:
            key = {k: getattr(c, k) for k in ("scenario", "camera", "bands", "variant")} | conditions
            mate = by_key.get((key["scenario"], key["camera"], key["bands"], key["variant"]))
            if is_selected(c) and mate is not None and mate is not c:
                measured.append((getattr(c, quantity) / getattr(mate, quantity), c))
        if measured:
            ratio, worst = max(measured, key=lambda one: one[0])
            names = (worst.scenario, worst.camera, worst.bands, worst.variant)
            yield Goal(name=name, measured=ratio, limit=limit, unit="x", worst=" ".join(filter(None, names)))

    def plain(c: CombinationCost) -> bool:
        return c.bands == "mono" and not c.variant

    goals = [
        *ratios(
            f"a scenario but at 3 m, beside {BASE}",
            1.7,
            lambda c: plain(c) and c.camera == PINHOLE and c.scenario != CLOSE,
            scenario=BASE,
        ),
        *ratios(
            f"{LENS} beside {PINHOLE}, frame", 1.3, lambda c: plain(c) and c.camera == LENS, camera=PINHOLE
        ),
        *ratios(
            f"{LENS} beside {PINHOLE}, captured",
            1.3,
            lambda c: plain(c) and c.camera == LENS,
            "capture_ms",
            camera=PINHOLE,
        ),
        *ratios(
            f"{FISHEYE} beside a pinhole of its size",
            1.5,
            lambda c: plain(c) and c.camera == FISHEYE,
            camera=PINHOLE_OF_ITS_SIZE,
        ),
        *ratios("rgb beside mono", 1.5, lambda c: c.bands == "rgb", bands="mono"),
        *ratios(
            "10 to 16 bits beside 8",
            1.5,
            lambda c: c.variant.startswith(("sensor imx174", "sensor cmv4000", "bits")),
            variant="",
        ),
        *ratios(
            "a craft of 100,000 triangles beside Tango",
            1.5,
            lambda c: c.variant.startswith("target"),
            variant="",
        ),
    ]
    for camera, limit_ms in ((PINHOLE, 120.0), (LENS, 160.0)):
        captured = by_key.get((BASE, camera, "mono", ""))
        if captured is not None:
            name = f"captured {BASE}, {camera}"
            goals.append(Goal(name=name, measured=captured.capture_ms, limit=limit_ms, unit="ms", worst=""))
    return tuple(goals)


def _combinations(scenarios: tuple[str, ...]) -> Iterator[_Combination]:
    for scenario in scenarios:
        for camera in list_cameras():
            for bands in _BANDS:
                yield _Combination(scenario, camera, bands)
    if BASE in scenarios:
        usual = load_scenario(BASE).sensor.preset
        variants = [f"sensor {name}" for name in list_sensor_presets() if name != usual]
        variants += [f"bits {bits}" for bits in BIT_DEPTHS]
        for variant in (*variants, f"target {LARGE_TARGET}"):
            yield _Combination(BASE, PINHOLE, "mono", variant)


def _plan(combination: _Combination, plans: dict[str, Plan], n_frames: int) -> Plan:
    """Return the plan of a combination; a scenario's flight is propagated once for all cameras."""
    if combination.variant:
        plan = _flown(_varied(load_scenario(combination.scenario), combination.variant), n_frames)
    else:
        if combination.scenario not in plans:
            plans.clear()
            plans[combination.scenario] = _flown(load_scenario(combination.scenario), n_frames)
        plan = plans[combination.scenario]
    return replace(plan, camera=load_camera(combination.camera), bands=combination.bands)


def _flown(scenario: Scenario, n_frames: int) -> Plan:
    """Return consecutive frames from the middle of the flight; the first two are the warm-up."""
    times = tuple(scenario.duration_s / 2 + STEP_S * k for k in range(n_frames + WARM_UP))
    return plan_flight(scenario, times=times)


def _varied(scenario: Scenario, variant: str) -> Scenario:
    setting, _, value = variant.partition(" ")
    if setting == "target":
        # at the distance at which the target is as large in the image
        ratio = _reach_m(value) / _reach_m(scenario.target)
        x, y, z = (float(ratio * part) for part in scenario.chaser.state_lvlh(0.0, 0.0)[0])
        chaser = Hold(position_lvlh_m=(x, y, z))
        return msgspec.structs.replace(scenario, target=value, chaser=chaser)
    changes = {"bits": int(value)} if setting == "bits" else {"preset": value}
    return msgspec.structs.replace(scenario, sensor=msgspec.structs.replace(scenario.sensor, **changes))


def _reach_m(target: str) -> float:
    """Return the largest distance of a vertex from the centre of the target's bounding box [m]."""
    vertices = load_target(target).occluders.vertices_m
    return float(np.linalg.norm(vertices - (vertices.min(axis=0) + vertices.max(axis=0)) / 2, axis=1).max())


def _cost(
    renderer: Renderer,
    reference: ReferencePass,
    combination: _Combination,
    plan: Plan,
    n_frames: int,
    device_index: int | None,
) -> CombinationCost:
    size = (plan.camera.width_px, plan.camera.height_px)
    scenes = tuple(replace(plan.scene(k), frame_index=k) for k in range(plan.n_frames))
    laps, rows, reference_laps = [], [], []
    for k, scene in enumerate(scenes):
        start = time.perf_counter()
        frame = take_frame(renderer, scene, plan.target, labels=False)
        lap_ms = (time.perf_counter() - start) * 1e3
        if k >= WARM_UP:
            laps.append(lap_ms)
            rows.append(frame.stage_ms)
    reference_laps += reference.laps_ms(size, n_frames)
    labels_ms, _ = labels_cost(renderer, plan.target, scenes, n_frames)
    return CombinationCost(
        **asdict(combination),
        width_px=size[0],
        height_px=size[1],
        frame_ms=float(np.median(laps)),
        render_ms=float(np.median([r["render"] for r in rows])),
        sensor_ms=float(np.median([r["sensor"] for r in rows])),
        labels_ms=labels_ms,
        capture_ms=_captured_ms(plan, device_index),
        reference_ms=float(np.median(reference_laps)),
    )


def _captured_ms(plan: Plan, device_index: int | None) -> float:
    """Return the median time of a frame that is rendered, labelled, checked and written, without the warm-up."""
    ends: list[float] = []
    with TemporaryDirectory() as folder:
        capture(
            plan,
            Path(folder) / "set",
            device_index=device_index,
            progress=lambda _done, _of: ends.append(time.perf_counter()),
        )
    return float(np.median(np.diff(ends)[WARM_UP - 1 :])) * 1e3
