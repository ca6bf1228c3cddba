"""The face: public API and command line. Composes everything, holds no logic.

>>> import flyaround as fa
>>> plan = fa.plan_flight(fa.load_scenario("tango-flyaround"), n=3)
>>> with fa.Renderer() as renderer:
...     frame = fa.take_frame(renderer, plan.scene(0), plan.target)
"""

from simulator.camera.files import list_cameras, load_camera
from simulator.camera.model import Camera
from simulator.camera.sensor import Sensor
from simulator.dataset.capture import capture
from simulator.dataset.check import check_dataset
from simulator.dataset.picture import render_scene, save_picture
from simulator.errors import UserError
from simulator.labels.frame import Frame, take_frame
from simulator.labels.overlay import draw_truth
from simulator.labels.truth import Truth, read_truth
from simulator.loop import Plan, Sink, plan_flight, run_frames
from simulator.render.renderer import Renderer
from simulator.scenario import Scenario
from simulator.scenario_load import list_scenarios, load_scenario
from simulator.scene.state import Environment, SceneState
from simulator.targets.glb import load_glb, write_glb
from simulator.targets.library import list_targets, load_target
from simulator.targets.model import Target
from simulator.world.pose import Pose

__all__ = [
    "Camera",
    "Environment",
    "Frame",
    "Plan",
    "Pose",
    "Renderer",
    "Scenario",
    "SceneState",
    "Sensor",
    "Sink",
    "Target",
    "Truth",
    "UserError",
    "capture",
    "check_dataset",
    "draw_truth",
    "list_cameras",
    "list_scenarios",
    "list_targets",
    "load_camera",
    "load_glb",
    "load_scenario",
    "load_target",
    "plan_flight",
    "read_truth",
    "render_scene",
    "run_frames",
    "save_picture",
    "take_frame",
    "write_glb",
]
