"""Feeds beside that of the chaser's camera: the free camera's, and the one of labels."""

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
"""Share of the render process's time of the chaser's camera; that of another view is 1."""


def further_feeds(turns: Turns, options: Options) -> dict[str, Feed]:
    """Return a feed for each kind of further view, by name; one is updated only while it is looked at.

    Parameters
    ----------
    turns : at the render process. options : of the operator, read anew for every picture.
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
