"""Pictures for the window, drawn in a process of their own: the UI owns the window's context alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

from gui.feed import PicturesLostError
from simulator.errors import UserError
from simulator.frame import Frame, take_frame
from simulator.runtime.process import ProcessDiedError, RenderProcess
from simulator.targets.library import target_in_use

if TYPE_CHECKING:
    from collections.abc import Iterator

    from simulator.render.renderer import Renderer
    from simulator.scene.state import SceneState

# One being drawn and one waiting: more would only make the picture older.
AHEAD = 2
MOST_DEATHS = 3
"""Render processes that may die one after the other without having drawn a picture."""


def draw(renderer: Renderer, scene: SceneState, *, labels: bool = False, timed: bool = False) -> Frame:
    """What the render process does for each scene; the radiance stays there, the window has no use for it."""
    renderer.timed = timed
    frame = take_frame(renderer, scene, target_in_use(scene.target.name, scene.target.sha256), labels=labels)
    return frame.without_radiance()


class RenderedPictures:
    """The render process as the feed wants it: never waits, and a failure is one sentence.

    A process that dies is followed by another; what the one had under way is lost.

    Parameters
    ----------
    device_index : EGL device to draw on. first : the first scene to come, for a quicker first picture.
    """

    def __init__(self, device_index: int | None = None, *, first: SceneState | None = None) -> None:
        self._device_index, self._deaths = device_index, 0
        self._process = self._start(first)

    def _start(self, first: SceneState | None) -> RenderProcess[Frame]:
        return RenderProcess(draw, device_index=self._device_index, capacity=AHEAD, first=first)

    def submit(self, scene: SceneState, *, labels: bool = False, timed: bool = False) -> bool:
        """Queue a scene; False when enough are under way. ``timed``: each pass by itself."""
        if not self._process.has_room:
            return False
        try:
            self._process.submit(scene, labels=labels, timed=timed)
        except ProcessDiedError as error:
            raise self._restart(error, scene) from error
        except RuntimeError as error:
            raise _stopped(error) from error
        return True

    def results(self) -> Iterator[Frame]:
        """The pictures finished by now."""
        try:
            while self._process.ready():
                picture = self._process.result()
                self._deaths = 0
                yield picture
        except ProcessDiedError as error:
            raise self._restart(error, None) from error
        except RuntimeError as error:
            raise _stopped(error) from error

    def _restart(self, error: ProcessDiedError, first: SceneState | None) -> Exception:
        """Start another process in place of one that died, unless they die one after the other."""
        self._deaths += 1
        if self._deaths >= MOST_DEATHS:
            return _stopped(error)
        self._process.close()
        self._process = self._start(first)
        return PicturesLostError(
            f"the drawing process died (exit code {error.exit_code}) and is started again; the flight goes on"
        )

    @property
    def pid(self) -> int | None:
        """Number of the process that draws now."""
        return self._process.pid

    def close(self) -> None:
        """End the process."""
        self._process.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _stopped(error: RuntimeError) -> UserError:
    last = str(error).strip().splitlines()[-1]
    return UserError(
        f"the console's render process failed ({last}); run flyaround -vv sim for more, or flyaround doctor"
    )
