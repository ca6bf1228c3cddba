"""The face: public API and command line. Composes everything, holds no logic.

>>> import flyaround as fa
>>> plan = fa.plan_flight(fa.load_scenario("tango-flyaround"), n=3)
>>> with fa.Renderer() as renderer:
...     frame = fa.take_frame(renderer, plan.scene(0), plan.target)
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hil.board.svd import PoseResult
    from hil.evaluate.estimate import estimate
    from simulator.camera.detector.sensor import Sensor
    from simulator.camera.lens.camera_model import Camera
    from simulator.camera.lens.files import list_cameras, load_camera
    from simulator.dataset.capture import capture
    from simulator.dataset.check.verify import check_dataset
    from simulator.dataset.formats.labelled_frame import LabelledFrame
    from simulator.dataset.labelled_dataset import LabelledDataset, open_dataset
    from simulator.dataset.single_frames import render_scene, save_picture
    from simulator.errors import UserError
    from simulator.frame import Frame, take_frame
    from simulator.labels.overlay import draw_truth
    from simulator.labels.truth import Truth, read_truth
    from simulator.loop import Sink, run_frames
    from simulator.recipes.load import list_recipes, load_recipe
    from simulator.recipes.plan import plan_recipe, varied_plan
    from simulator.recipes.vary_file import load_vary
    from simulator.render.renderer import Renderer
    from simulator.scenario.load import list_scenarios, load_scenario
    from simulator.scenario.plan import Plan, plan_flight
    from simulator.scenario.poses import scene_at
    from simulator.scenario.scenario import Scenario
    from simulator.scene.environments import Environment
    from simulator.scene.state import SceneState
    from simulator.targets.glb.read import load_glb
    from simulator.targets.glb.write import write_glb
    from simulator.targets.library import list_targets, load_target
    from simulator.targets.model import Target
    from simulator.world.frames.pose import Pose

    __version__: str

__all__ = [
    "Camera",
    "Environment",
    "Frame",
    "LabelledDataset",
    "LabelledFrame",
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

# imported at first use: a program that only draws does not wait for what writes data sets
_HOMES = {
    "Camera": "simulator.camera.lens.camera_model",
    "Environment": "simulator.scene.environments",
    "Frame": "simulator.frame",
    "LabelledDataset": "simulator.dataset.labelled_dataset",
    "LabelledFrame": "simulator.dataset.formats.labelled_frame",
    "Plan": "simulator.scenario.plan",
    "Pose": "simulator.world.frames.pose",
    "PoseResult": "hil.board.svd",
    "Renderer": "simulator.render.renderer",
    "Scenario": "simulator.scenario.scenario",
    "SceneState": "simulator.scene.state",
    "Sensor": "simulator.camera.detector.sensor",
    "Sink": "simulator.loop",
    "Target": "simulator.targets.model",
    "Truth": "simulator.labels.truth",
    "UserError": "simulator.errors",
    "capture": "simulator.dataset.capture",
    "check_dataset": "simulator.dataset.check.verify",
    "draw_truth": "simulator.labels.overlay",
    "estimate": "hil.evaluate.estimate",
    "list_cameras": "simulator.camera.lens.files",
    "list_recipes": "simulator.recipes.load",
    "list_scenarios": "simulator.scenario.load",
    "list_targets": "simulator.targets.library",
    "load_camera": "simulator.camera.lens.files",
    "load_glb": "simulator.targets.glb.read",
    "load_recipe": "simulator.recipes.load",
    "load_scenario": "simulator.scenario.load",
    "load_target": "simulator.targets.library",
    "load_vary": "simulator.recipes.vary_file",
    "open_dataset": "simulator.dataset.labelled_dataset",
    "plan_flight": "simulator.scenario.plan",
    "plan_recipe": "simulator.recipes.plan",
    "read_truth": "simulator.labels.truth",
    "render_scene": "simulator.dataset.single_frames",
    "run_frames": "simulator.loop",
    "save_picture": "simulator.dataset.single_frames",
    "scene_at": "simulator.scenario.poses",
    "take_frame": "simulator.frame",
    "varied_plan": "simulator.recipes.plan",
    "write_glb": "simulator.targets.glb.write",
}


def __getattr__(name: str) -> Any:  # noqa: ANN401 - the type checker reads the imports above
    if name == "__version__":
        from importlib.metadata import version  # noqa: PLC0415 - slow to import, needed here alone

        return version("flyaround")
    if name not in _HOMES:
        raise AttributeError(f"module 'flyaround' has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
