"""The orbit camera's process: opened at its first picture, and no reason to end the console."""

from collections.abc import Iterable

from flyaround.gui.picture.feed import Feed, PictureKind
from flyaround.gui.picture.further import LaterFrames
from flyaround.simulator.frame import Frame
from flyaround.simulator.loop import FrameRequest
from flyaround.simulator.scene.state import SceneState
from tests.harness.flown_console import console_flying


class Broken:
    """A producer whose process died too often."""

    def submit(self, request: FrameRequest) -> bool:
        raise RuntimeError("the drawing process died three times")

    def finished(self) -> Iterable[Frame]:
        return ()


def test_it_is_opened_with_the_first_scene_and_its_loss_ends_nothing() -> None:
    console = console_flying("tango-space-10m")
    opened: list[SceneState] = []

    def open_producer(scene: SceneState) -> Broken:
        opened.append(scene)
        return Broken()

    frames = LaterFrames(open_producer)
    assert list(frames.finished()) == []
    assert opened == []
    feed = Feed(frames, kind=PictureKind(title="orbit camera", needed=False))
    assert not feed.update(console.session, console.options.settings)
    assert len(opened) == 1
    trouble = feed.take_trouble()
    assert trouble is not None
    assert trouble.startswith("no picture of the orbit camera: the drawing process died three times")
    console.close()
