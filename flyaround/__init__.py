"""Flyaround, a simulator of spacecraft close approach: the public API.

>>> import flyaround as fa
>>> plan = fa.plan_flight(fa.load_scenario("tango-flyaround"), n=3)
>>> with fa.Renderer() as renderer:
...     frame = fa.take_frame(renderer, plan.scene(0), plan.target)
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flyaround.lazy import lazy_names

if TYPE_CHECKING:
    from flyaround.hil.board.estimation import PoseResult
    from flyaround.hil.evaluate.estimate import estimate
    from flyaround.simulator.camera.detector.sensor import Sensor
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.camera.lens.files import list_cameras, load_camera
    from flyaround.simulator.dataset.capture import capture
    from flyaround.simulator.dataset.check.verify import check_dataset
    from flyaround.simulator.dataset.formats.labelled_frame import LabelledFrame
    from flyaround.simulator.dataset.labelled_dataset import LabelledDataset, open_dataset
    from flyaround.simulator.dataset.single_frames import render_scene, save_picture
    from flyaround.simulator.errors import UserError
    from flyaround.simulator.frame import Frame, take_frame
    from flyaround.simulator.labels.overlay import draw_truth
    from flyaround.simulator.labels.truth import Truth, read_truth
    from flyaround.simulator.loop import Sink, run_frames
    from flyaround.simulator.piloting.orders import PilotCommand
    from flyaround.simulator.piloting.session import FlightSession, FlightState
    from flyaround.simulator.recipes.plan import plan_recipe
    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.scenario.load import (
        list_recipes,
        list_scenarios,
        load_recipe,
        load_scenario,
        load_vary,
    )
    from flyaround.simulator.scenario.plan import Plan, plan_flight, varied_plan
    from flyaround.simulator.scenario.poses import scene_at
    from flyaround.simulator.scenario.scenario import Scenario
    from flyaround.simulator.scene.environments import Environment
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.glb.read import load_glb
    from flyaround.simulator.targets.glb.write import write_glb
    from flyaround.simulator.targets.library import list_targets, load_target
    from flyaround.simulator.targets.model import Target
    from flyaround.simulator.world.frames.pose import Pose

    __version__: str

__all__ = [
    "Camera",
    "Environment",
    "FlightSession",
    "FlightState",
    "Frame",
    "LabelledDataset",
    "LabelledFrame",
    "PilotCommand",
    "Plan",
    "Pose",
    "PoseResult",
    "Renderer",
    "Scenario",
    "SceneState",
    "Sensor",
    "Sink",
    "Target",
    "Truth",
    "UserError",
    "__version__",
    "capture",
    "check_dataset",
    "draw_truth",
    "estimate",
    "list_cameras",
    "list_recipes",
    "list_scenarios",
    "list_targets",
    "load_camera",
    "load_glb",
    "load_recipe",
    "load_scenario",
    "load_target",
    "load_vary",
    "open_dataset",
    "plan_flight",
    "plan_recipe",
    "read_truth",
    "render_scene",
    "run_frames",
    "save_picture",
    "scene_at",
    "take_frame",
    "varied_plan",
    "write_glb",
]

# imported on first use, so that a program that only renders does not load the data-set writers
_HOMES = {
    "Camera": "flyaround.simulator.camera.lens.camera_model",
    "Environment": "flyaround.simulator.scene.environments",
    "FlightSession": "flyaround.simulator.piloting.session",
    "FlightState": "flyaround.simulator.piloting.session",
    "Frame": "flyaround.simulator.frame",
    "LabelledDataset": "flyaround.simulator.dataset.labelled_dataset",
    "LabelledFrame": "flyaround.simulator.dataset.formats.labelled_frame",
    "PilotCommand": "flyaround.simulator.piloting.orders",
    "Plan": "flyaround.simulator.scenario.plan",
    "Pose": "flyaround.simulator.world.frames.pose",
    "PoseResult": "flyaround.hil.board.estimation",
    "Renderer": "flyaround.simulator.render.renderer",
    "Scenario": "flyaround.simulator.scenario.scenario",
    "SceneState": "flyaround.simulator.scene.state",
    "Sensor": "flyaround.simulator.camera.detector.sensor",
    "Sink": "flyaround.simulator.loop",
    "Target": "flyaround.simulator.targets.model",
    "Truth": "flyaround.simulator.labels.truth",
    "UserError": "flyaround.simulator.errors",
    "capture": "flyaround.simulator.dataset.capture",
    "check_dataset": "flyaround.simulator.dataset.check.verify",
    "draw_truth": "flyaround.simulator.labels.overlay",
    "estimate": "flyaround.hil.evaluate.estimate",
    "list_cameras": "flyaround.simulator.camera.lens.files",
    "list_recipes": "flyaround.simulator.scenario.load",
    "list_scenarios": "flyaround.simulator.scenario.load",
    "list_targets": "flyaround.simulator.targets.library",
    "load_camera": "flyaround.simulator.camera.lens.files",
    "load_glb": "flyaround.simulator.targets.glb.read",
    "load_recipe": "flyaround.simulator.scenario.load",
    "load_scenario": "flyaround.simulator.scenario.load",
    "load_target": "flyaround.simulator.targets.library",
    "load_vary": "flyaround.simulator.scenario.load",
    "open_dataset": "flyaround.simulator.dataset.labelled_dataset",
    "plan_flight": "flyaround.simulator.scenario.plan",
    "plan_recipe": "flyaround.simulator.recipes.plan",
    "read_truth": "flyaround.simulator.labels.truth",
    "render_scene": "flyaround.simulator.dataset.single_frames",
    "run_frames": "flyaround.simulator.loop",
    "save_picture": "flyaround.simulator.dataset.single_frames",
    "scene_at": "flyaround.simulator.scenario.poses",
    "take_frame": "flyaround.simulator.frame",
    "varied_plan": "flyaround.simulator.scenario.plan",
    "write_glb": "flyaround.simulator.targets.glb.write",
}


_get = lazy_names(__name__, _HOMES)


def __getattr__(name: str) -> Any:  # noqa: ANN401 - the type checker reads the imports above
    if name == "__version__":
        from importlib.metadata import version  # noqa: PLC0415 - slow to import, and rarely needed

        return version("flyaround")
    return _get(name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
