"""A frame producer that takes no picture, for tests of a console whose flight alone counts."""

from __future__ import annotations


class NoRenderer:
    """Refuses every request; `flyaround.gui.picture.feed.FramesOnRequest`."""

    def submit(self, request: object) -> bool:
        return False

    def finished(self) -> tuple[()]:
        return ()
