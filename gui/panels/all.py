"""Every panel and view, in the order of the menu; `flyaround.gui.layout` opens, docks and names them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, Protocol

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
from flyaround.gui.panels.scenarios import ScenarioChooser
from flyaround.gui.panels.sensor import SensorPanel
from flyaround.gui.panels.steering import SteeringPanel
from flyaround.gui.panels.target import TargetPanel
from flyaround.gui.panels.time import TimePanel
from flyaround.gui.panels.timeline import TimelinePanel
from flyaround.gui.panels.tour import TourPanel
from flyaround.gui.views.camera import CameraView
from flyaround.gui.views.earth_map import EarthMap
from flyaround.gui.views.labels import DepthView, KeypointsView, PartsView
from flyaround.gui.views.lvlh_map import LvlhMap
from flyaround.gui.views.orbit_camera import OrbitCameraView

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.gui.window import Window

Place = Literal["centre", "right", "right-upper", "right-middle", "right-low", "left", "bottom", "over"]


class Panel(Protocol):
    """What the layout needs of a panel.

    ``name`` is of its command (``panel.NAME``), ``place`` where it is docked at first (``over``: a window of its own in
    the middle), ``shown`` whether it is open at first. Further, if it has them: ``keys`` of its
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
