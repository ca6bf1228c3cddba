"""Every panel and view, in the order of tabs; `flyaround.gui.layout` opens, docks and names them."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flyaround.gui.widgets import Panel

CLASSES = """
views.camera:CameraView
panels.estimator:EstimatorPanel panels.board_link:BoardLinkPanel panels.capture:CapturePanel panels.chaser:ChaserPanel
views.lvlh_map:LvlhMap views.earth_map:EarthMap views.orbit_camera:OrbitCameraView views.labels:DepthView
views.labels:PartsView views.labels:KeypointsView panels.picture:PicturePanel panels.picture:WorldPanel
panels.sensor:SensorPanel panels.target:TargetPanel panels.lights:LightsPanel panels.command_line:CommandLinePanel
panels.timeline:TimelinePanel panels.steering:SteeringPanel panels.plots:PlotsPanel panels.docking:DockingPanel
panels.tour:TourPanel panels.scenarios:ScenarioChooser panels.flights:FlightsPanel panels.editor:EditorPanel
panels.log:LogPanel panels.key_list:KeyList panels.key_list:Palette panels.help:HelpPanel
panels.quit_question:QuitQuestion
"""


def _class(name: str) -> type[Panel]:
    module, _, kind = name.partition(":")
    panel: type[Panel] = getattr(import_module(f"flyaround.gui.{module}"), kind)
    return panel


PANELS = tuple(_class(name) for name in CLASSES.split())
