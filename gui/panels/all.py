"""Every panel and view, in the order of the menu; `gui.layout` opens, docks and names them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, Protocol

from gui.panels.board_link import BoardLinkPanel
from gui.panels.capture import CapturePanel
from gui.panels.chaser import ChaserPanel
from gui.panels.command_line import CommandLinePanel
from gui.panels.docking import DockingPanel
from gui.panels.editor import EditorPanel
from gui.panels.estimator import EstimatorPanel
from gui.panels.help import HelpPanel
from gui.panels.key_list import KeyList, Palette
from gui.panels.log import LogPanel
from gui.panels.passes import PassesPanel
from gui.panels.picture import PicturePanel, WorldPanel
from gui.panels.scenarios import ScenarioChooser
from gui.panels.sensor import SensorPanel
from gui.panels.steering import SteeringPanel
from gui.panels.target import TargetPanel
from gui.panels.time import TimePanel
from gui.panels.timeline import TimelinePanel
from gui.panels.tour import TourPanel
from gui.views.camera import CameraView
from gui.views.earth_map import EarthMap
from gui.views.labels import DepthView, KeypointsView, PartsView
from gui.views.lvlh_map import LvlhMap
from gui.views.orbit_camera import OrbitCameraView

if TYPE_CHECKING:
    from gui.console import Console
    from gui.window import Window

Place = Literal["centre", "right", "right-upper", "right-middle", "right-low", "left", "bottom", "over"]


class Panel(Protocol):
    """What the layout needs of a panel.

    ``name`` is of its command (``panel.NAME``), ``place`` where it is docked at first (``over``: a window of its own in
    the middle), ``shown`` whether it is open at first. Further, if it has them: ``keys`` and ``shown_keys`` of its
    command, ``bare`` if it draws up to its edges.
    """

    name: str
    title: str
    place: str
    shown: bool

    def __init__(self, window: Window) -> None: ...

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""


PANELS: tuple[type[Panel], ...] = (
    CameraView,
    ScenarioChooser,
    EditorPanel,
    EstimatorPanel,
    BoardLinkPanel,
    CapturePanel,
    TimePanel,
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
    DockingPanel,
    LogPanel,
    KeyList,
    Palette,
    HelpPanel,
    TourPanel,
)
