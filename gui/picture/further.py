"""Feeds other than the chaser camera's: the free camera's, and that of labels."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui.picture.feed import Feed, PictureKind
from flyaround.gui.picture.label_images import LABELS, LABELS_EVERY_S
from flyaround.gui.picture.orbit_picture import orbit_scene

if TYPE_CHECKING:
    from flyaround.gui.picture.turns import Turns
    from flyaround.gui.picture.view_settings import Options, ViewSettings
    from flyaround.simulator.piloting.session import FlightSession
    from flyaround.simulator.scene.state import Quality, SceneState

ORBIT_CAMERA, LABEL_VIEWS = "orbit-camera", "labels"
CAMERA_SHARE = 2.0
"""Weight of the chaser's camera in the render process's time; that of another view is 1."""


def further_feeds(turns: Turns, options: Options) -> dict[str, Feed]:
    """Return a feed for each further view, by name; it requests pictures only while visible.

    Parameters
    ----------
    turns : Turns
        Access to the render process.
    options : Options
        The operator's settings, read for every picture.
    """

    def orbit(
        session: FlightSession, settings: ViewSettings, divisor: int, quality: Quality | None
    ) -> SceneState:
        return orbit_scene(session, settings, options.orbit, divisor, quality)

    kinds = {
        ORBIT_CAMERA: PictureKind(scene=orbit, title="orbit camera", needed=False),
        LABEL_VIEWS: PictureKind(labels=LABELS, every_s=LABELS_EVERY_S, title="labels", needed=False),
    }
    return {name: Feed(turns.channel(), kind=kind) for name, kind in kinds.items()}
