"""Every panel and view, in the order of the menu; `flyaround.gui.layout` opens, docks and names them."""

from __future__ import annotations

from flyaround.gui.panels.board_link import BoardLinkPanel
from flyaround.gui.panels.capture import CapturePanel
from flyaround.gui.panels.chaser import ChaserPanel
from flyaround.gui.panels.command_line import CommandLinePanel
from flyaround.gui.panels.docking import DockingPanel
from flyaround.gui.panels.editor import EditorPanel
from flyaround.gui.panels.estimator import EstimatorPanel
from flyaround.gui.panels.help import HelpPanel
from flyaround.gui.panels.key_list import KeyList, Palette
from flyaround.gui.panels.log import LogPanel
from flyaround.gui.panels.passes import PassesPanel
from flyaround.gui.panels.picture import PicturePanel, WorldPanel
from flyaround.gui.panels.plots import PlotsPanel
from flyaround.gui.panels.scenarios import ScenarioChooser
from flyaround.gui.panels.sensor import SensorPanel
from flyaround.gui.panels.steering import SteeringPanel
from flyaround.gui.panels.target import TargetPanel
from flyaround.gui.panels.timeline import TimelinePanel
from flyaround.gui.panels.tour import TourPanel
from flyaround.gui.views.camera import CameraView
from flyaround.gui.views.earth_map import EarthMap
from flyaround.gui.views.labels import DepthView, KeypointsView, PartsView
from flyaround.gui.views.lvlh_map import LvlhMap
from flyaround.gui.views.orbit_camera import OrbitCameraView
from flyaround.gui.widgets import Panel

PANELS: tuple[type[Panel], ...] = (
    CameraView,
    ScenarioChooser,
    EditorPanel,
    EstimatorPanel,
    BoardLinkPanel,
    CapturePanel,
    ChaserPanel,
    LvlhMap,
    EarthMap,
    OrbitCameraView,
    DepthView,
    PartsView,
    KeypointsView,
    PicturePanel,
    WorldPanel,
    PassesPanel,
    SensorPanel,
    TargetPanel,
    CommandLinePanel,
    TimelinePanel,
    SteeringPanel,
    PlotsPanel,
    DockingPanel,
    LogPanel,
    KeyList,
    Palette,
    HelpPanel,
    TourPanel,
)
