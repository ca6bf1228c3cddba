"""Feeds other than the chaser camera's: the free camera's, from a process of its own, and that of labels."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui.picture.feed import Feed, PictureKind
from flyaround.gui.picture.label_images import LABELS, LABELS_EVERY_S
from flyaround.gui.picture.orbit_picture import orbit_scene
from flyaround.gui.picture.turns import Turns

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from flyaround.gui.picture.feed import FramesOnRequest
    from flyaround.gui.picture.view_settings import Options
    from flyaround.simulator.frame import Frame
    from flyaround.simulator.loop import FrameRequest
    from flyaround.simulator.scene.state import SceneState

ORBIT_CAMERA, LABEL_VIEWS = "orbit-camera", "labels"
CAMERA_SHARE = 2.0
"""Weight of the chaser's camera in the render process's time; that of another view is 1."""


class LaterFrames:
    """Frame producer that is opened at its first request: a view that is never shown costs nothing.

    Parameters
    ----------
    open_producer : callable
        Function of the first scene that returns the producer.
    """

    def __init__(self, open_producer: Callable[[SceneState], FramesOnRequest]) -> None:
        self._open = open_producer
        self._producer: FramesOnRequest | None = None

    def submit(self, request: FrameRequest) -> bool:
        """Request a frame; return False if enough are in flight."""
        if self._producer is None:
            self._producer = self._open(request.scene)
        return self._producer.submit(request)

    def finished(self) -> Iterable[Frame]:
        """Return the frames finished since the last call."""
        return () if self._producer is None else self._producer.finished()


def further_feeds(turns: Turns, orbit_frames: FramesOnRequest, options: Options) -> dict[str, Feed]:
    """Return a feed for each further view, by name; it requests pictures only while visible.

    Parameters
    ----------
    turns : Turns
        Access to the render process of the chaser's camera, for labels.
    orbit_frames : FramesOnRequest
        Producer of the free camera's pictures, which need maps of the Earth that the chaser may not see.
    options : Options
        The operator's settings, read for every picture.
    """
    outside = PictureKind(
        scene=lambda session, settings, *rest: orbit_scene(session, settings, options.orbit, *rest),
        title="orbit camera",
        needed=False,
    )
    labels = PictureKind(labels=LABELS, every_s=LABELS_EVERY_S, title="labels", needed=False)
    return {
        ORBIT_CAMERA: Feed(Turns(orbit_frames).channel(), kind=outside),
        LABEL_VIEWS: Feed(turns.channel(), kind=labels),
    }
