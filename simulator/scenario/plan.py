"""Plans: the times of a flight that become frames, and the scene of each."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, get_args

import msgspec
import numpy as np

from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.errors import UserError
from flyaround.simulator.imaging.auto_exposure import ExposureTrack
from flyaround.simulator.imaging.metering import metered_exposure_s
from flyaround.simulator.scenario.flight import fly, frame_times
from flyaround.simulator.scenario.variation import FrameVariation
from flyaround.simulator.scene.build import build_scene
from flyaround.simulator.scene.illumination.bands import Bands
from flyaround.simulator.scene.state import Quality, SceneState, TargetRef
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.targets.model import Target

if TYPE_CHECKING:
    from flyaround.simulator.scenario.recipe import Recipe
    from flyaround.simulator.scenario.scenario import Scenario
    from flyaround.simulator.scenario.vary import Vary
    from flyaround.simulator.scene.second_camera import SecondCamera
    from flyaround.simulator.world.flight.flight import Flight
    from flyaround.simulator.world.flight.world_state import WorldState


class FramePlan(Protocol):
    """A sequence of frames of one target, from a flight, a recipe or a list of poses."""

    @property
    def n_frames(self) -> int:
        """Number of frames."""

    @property
    def target(self) -> Target:
        """The model to draw."""

    def scene(self, k: int) -> SceneState:
        """Return the scene of frame k.

        Returns
        -------
        SceneState
            Scene at mid-exposure.
        """


class Exposures(Protocol):
    """The exposure along a flight."""

    def exposure_s(self, t_s: float) -> float:
        """Return the exposure at a time of the flight.

        Returns
        -------
        float
            Exposure time [s].
        """


@dataclass(frozen=True, eq=False, kw_only=True)
class DocumentPlan(ABC):
    """Frames of a scenario or a recipe; ``scene(k)`` depends on (document, seed, k) only.

    Parameters
    ----------
    target : Target
        Model of the target.
    camera : Camera
        Camera of the frames.
    seed : int
        Seed of every random draw.
    bands : str, optional
        ``mono`` (panchromatic) or ``rgb``.
    quality : str, optional
        Preset of the renderer.
    every_s : float, optional
        Spacing of the frames, or None.
    vary : Vary, optional
        Ranges within which each frame is varied.
    """

    target: Target
    camera: Camera
    seed: int
    bands: Bands = "mono"
    quality: Quality = "default"
    every_s: float | None = None
    vary: Vary | None = None

    if TYPE_CHECKING:

        @property
        def n_frames(self) -> int:
            """Number of frames."""

    @property
    @abstractmethod
    def document(self) -> Scenario | Recipe:
        """The scenario or recipe."""

    @abstractmethod
    def planned_scene(self, k: int) -> SceneState:
        """Return the scene of frame k before variation.

        Returns
        -------
        SceneState
            Scene at mid-exposure, with ``k`` as frame number.
        """

    @abstractmethod
    def next_scene(self, k: int) -> SceneState | None:
        """Return the scene to which frame k's optical flow leads.

        Returns
        -------
        SceneState or None
            Scene at mid-exposure; None if no frame follows k in its sequence.
        """

    @property
    def scenario_name(self) -> str:
        """Name of the scenario or recipe."""
        return self.document.name

    @property
    def scenario_document(self) -> dict[str, Any]:
        """The scenario or recipe as a JSON-able document, with the ranges if there are any."""
        document = msgspec.json.decode(msgspec.json.encode(self.document))
        ranges = {} if self.vary is None else {"vary": msgspec.json.decode(msgspec.json.encode(self.vary))}
        return {**document, **ranges}

    @property
    def second_camera(self) -> SecondCamera | None:
        """A second camera of the same instants, if there is one."""
        return self.document.second_camera

    @property
    def labels(self) -> tuple[str, ...]:
        """Label layers that the scenario or recipe requests."""
        return self.document.output.labels

    def scene(self, k: int) -> SceneState:
        """Return the scene of frame k.

        Returns
        -------
        SceneState
            Scene at mid-exposure, varied if there are ranges.

        Raises
        ------
        UserError
            If a recipe's constraints allow no pose, or the ranges do not fit the sensor.
        """
        scene, vary = self.planned_scene(k), self.vary
        return scene if vary is None else FrameVariation(vary, self.seed, self.target).scene(scene, k)

    def target_of(self, k: int) -> Target:
        """Return the craft of frame k.

        Returns
        -------
        Target
            The plan's model, with varied surfaces and shape if the ranges vary them.
        """
        return self.scene(k).target.drawn(self.target)


P = TypeVar("P", bound=DocumentPlan)


@dataclass(frozen=True, eq=False, kw_only=True)
class Plan(DocumentPlan):
    """Frames at given times of a propagated flight.

    Parameters
    ----------
    scenario : Scenario
        The scenario.
    flight : Flight
        Its propagated flight.
    times_s : tuple of float
        Mid-exposure of each frame, from the flight's start [s].
    exposures : Exposures, optional
        Automatic exposure along the flight; None for a fixed one.
    """

    scenario: Scenario
    flight: Flight
    times_s: tuple[float, ...]
    exposures: Exposures | None = None

    @property
    def document(self) -> Scenario:
        """The scenario."""
        return self.scenario

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.times_s)

    def planned_scene(self, k: int) -> SceneState:
        """Return the scene of frame k before it is varied.

        Returns
        -------
        SceneState
            Scene at mid-exposure.
        """
        t = self.times_s[k]
        exposure = None if self.exposures is None else self.exposures.exposure_s(t)
        return self._scene(self.flight.state(t), k, exposure)

    def next_scene(self, k: int) -> SceneState | None:
        """Return the scene after frame k's, or None after the last.

        Returns
        -------
        SceneState or None
            Scene at mid-exposure.
        """
        return self.scene(k + 1) if k + 1 < self.n_frames else None

    def scene_of(self, world: WorldState, k: int) -> SceneState:
        """Return the scene of a world state as frame k of this plan, for piloted flights.

        A piloted flight has no known future, so its automatic exposure is the meter's, without lag.

        Returns
        -------
        SceneState
            Scene at the time of the world state.
        """
        scene = self._scene(world, k, None)
        auto = self.scenario.auto_exposure
        if auto is None:
            return scene
        return replace(scene, exposure_s=metered_exposure_s(auto, scene, self.target))

    def _scene(self, world: WorldState, k: int, exposure_s: float | None) -> SceneState:
        scenario = self.scenario
        return build_scene(
            world,
            camera=self.camera,
            sensor=scenario.sensor_model,
            exposure_s=scenario.sensor.exposure_s if exposure_s is None else exposure_s,
            target=TargetRef(name=self.target.name, sha256=self.target.sha256),
            com_target_m=self.target.mass.com_m,
            frame_index=k,
            seed=self.seed,
            quality=self.quality,
            bands=self.bands,
            environment=scenario.environment.layers(),
            shutter=scenario.sensor.shutter_model,
            optics=scenario.optics.optics(),
            lamp=scenario.lamp,
            lights=scenario.lights,
        )

    def shifted(self, times_s: tuple[float, ...]) -> Plan:
        """Return the same flight with other frame times.

        Returns
        -------
        Plan
            Plan with as many frames as times.
        """
        return replace(self, times_s=times_s, every_s=None)


def varied_plan(plan: P, vary: Vary) -> P:
    """Return a plan with frames varied within these ranges instead of a recipe's own.

    Returns
    -------
    Plan
        Plan of the same kind as the given one.

    Raises
    ------
    UserError
        If a black level is varied of a sensor that counts no electrons.
    """
    varied = replace(plan, vary=vary)
    varied.scene(0)  # refuse impossible ranges before anything is written
    return varied


def check_plan_options(n: int | None, seed: int | None, bands: Bands | None, quality: Quality | None) -> None:
    """Raise UserError if an option of a plan, by default None, is not one of those that are allowed."""
    if n is not None and not (_is_whole(n) and n >= 1):
        raise UserError(f"the number of frames is {n}, allowed: at least 1")
    if seed is not None and not (_is_whole(seed) and 0 <= seed < 2**63):
        raise UserError(f"the seed is {seed}, allowed: 0 or more, below 2^63")
    for name, value, kind in (("bands", bands, Bands), ("quality", quality, Quality)):
        if value is not None and value not in get_args(kind):
            raise UserError(f"{name} is {value!r}, allowed: {', '.join(get_args(kind))}")


def _is_whole(value: object) -> bool:
    return isinstance(value, (int, np.integer))


def plan_flight(
    scenario: Scenario,
    *,
    n: int | None = None,
    every_s: float | None = None,
    times: tuple[float, ...] | None = None,
    seed: int | None = None,
    bands: Bands | None = None,
    quality: Quality | None = None,
) -> Plan:
    """Propagate a scenario and choose its frames: ``n`` evenly in time, one ``every_s``, or at ``times``.

    Returns
    -------
    Plan
        Flight of both craft, and its frames.

    Raises
    ------
    UserError
        If a time is outside the flight, or the scenario names something unknown.
    """
    check_plan_options(n, seed, bands, quality)
    target = load_target(scenario.target)
    if times is not None and not times:
        raise UserError("a plan without times has no frames: give one time or more")
    if times is None:
        times = tuple(float(t) for t in frame_times(scenario.duration_s, n, every_s))
    for t in times:
        if not 0 <= t <= scenario.duration_s:
            raise UserError(
                f"time {t:g} s is outside scenario {scenario.name}, which lasts {scenario.duration_s:g} s; "
                "choose -t within it"
            )
    plan = Plan(
        scenario=scenario,
        flight=fly(scenario, target),
        target=target,
        camera=scenario.camera_in(bands or scenario.output.bands),
        times_s=times,
        every_s=every_s,
        seed=scenario.seed if seed is None else seed,
        bands=bands or scenario.output.bands,
        quality=quality or scenario.output.quality,
    )
    auto = scenario.auto_exposure
    if auto is None:
        return plan
    # the meter uses the plan's own view; the plan's exposure does not affect it
    return replace(
        plan, exposures=ExposureTrack(auto, lambda t: plan.scene_of(plan.flight.state(t), 0).exposure_s)
    )
