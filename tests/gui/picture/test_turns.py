"""Several picture views at one render process: fair shares, no starving, every view told of a loss."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import numpy as np
import pytest

from flyaround.gui.picture.feed import Feed, PictureKind
from flyaround.gui.picture.turns import Turns
from flyaround.gui.picture.view_settings import ViewSettings, apply_view_settings
from flyaround.simulator.errors import UserError
from flyaround.simulator.frame import Frame
from flyaround.simulator.labels.request import LabelRequest
from flyaround.simulator.loop import FrameRequest
from flyaround.simulator.piloting.orders import PilotCommand
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.runtime.worker import ProcessDiedError
from flyaround.simulator.runtime.worker_pool import JobsLostError
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scene.state import SceneState


class Slow:
    """A producer of one process on a clock of its own: two under way, each as long as its ``cost_ms`` says."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.cost_ms: dict[float, float] = {}
        self.asked: list[FrameRequest] = []
        self.drawn_ms: Counter[float] = Counter()
        self.lose = ""

    def submit(self, request: FrameRequest) -> bool:
        if len(self.asked) == 2:
            return False
        self.asked.append(request)
        return True

    def finished(self) -> Iterable[Frame]:
        if self.lose:
            why, self.lose = self.lose, ""
            self.asked.clear()
            raise JobsLostError(why)
        return []

    def draw(self) -> Frame:
        request = self.asked.pop(0)
        scene = request.scene
        ms = self.cost_ms.get(scene.exposure_s, 20.0)
        self.now_s += ms / 1e3
        self.drawn_ms[scene.exposure_s] += ms
        return Frame(scene, np.zeros((2, 2), np.uint8), np.zeros((2, 2), np.float32), stage_ms={"render": ms})


class Bench:
    """Channels that always want, and a producer that is always at work."""

    def __init__(self, scene: SceneState, costs_ms: dict[float, float], shares: dict[float, float]) -> None:
        self.producer = Slow()
        self.producer.cost_ms = costs_ms
        self.turns = Turns(self.producer, lambda: self.producer.now_s)
        self.scenes = {key: _marked(scene, key) for key in costs_ms}
        self.channels = {key: self.turns.channel(shares.get(key, 1.0)) for key in costs_ms}
        self.taken: Counter[float] = Counter()

    def run(self, until_s: float, wanting: set[float]) -> None:
        finished: list[Frame] = []
        self.producer.finished = lambda: [finished.pop()] if finished else []  # type: ignore[method-assign]
        while self.producer.now_s < until_s:
            for _ in range(3):
                for key in wanting:
                    self.channels[key].submit(FrameRequest(scene=self.scenes[key], labels=False))
            assert self.producer.asked, "the render process has nothing to do"
            finished.append(self.producer.draw())
            for key, channel in self.channels.items():
                for frame in channel.finished():
                    assert frame.scene is self.scenes[key], "a picture came to another view"
                    self.taken[key] += 1


def _marked(scene: SceneState, exposure_s: float) -> SceneState:
    return apply_view_settings(
        scene,
        ViewSettings(
            bands=scene.bands,
            environment=scene.environment,
            exposure_stops=float(np.log2(exposure_s / scene.exposure_s)),
        ),
    )


@pytest.fixture(scope="module")
def session() -> FlightSession:
    return FlightSession.of(load_scenario("tango-flyaround"))


def of_exposure(counter: Counter[float], key: float) -> float:
    return next(v for k, v in counter.items() if k == pytest.approx(key))


def test_time_is_shared_evenly_whatever_a_picture_costs(session: FlightSession) -> None:
    costs = {1e-3: 20.0, 2e-3: 20.0, 4e-3: 300.0}
    bench = Bench(session.scene(), costs, {})
    bench.producer.cost_ms = {s.exposure_s: costs[k] for k, s in bench.scenes.items()}
    bench.run(60.0, set(costs))
    spent = [of_exposure(bench.producer.drawn_ms, k) for k in costs]
    assert max(spent) < 1.1 * min(spent)
    assert sum(bench.taken.values()) > 100


def test_a_larger_share_gets_more(session: FlightSession) -> None:
    costs = {1e-3: 25.0, 2e-3: 25.0}
    bench = Bench(session.scene(), costs, {1e-3: 3.0})
    bench.producer.cost_ms = {s.exposure_s: costs[k] for k, s in bench.scenes.items()}
    bench.run(20.0, set(costs))
    assert bench.taken[1e-3] / bench.taken[2e-3] == pytest.approx(3.0, rel=0.1)


def test_who_comes_late_does_not_push_the_others_out(session: FlightSession) -> None:
    costs = {1e-3: 20.0, 2e-3: 20.0}
    bench = Bench(session.scene(), costs, {})
    bench.producer.cost_ms = {s.exposure_s: costs[k] for k, s in bench.scenes.items()}
    bench.run(30.0, {1e-3})
    before = bench.taken[1e-3]
    bench.run(32.0, set(costs))
    assert bench.taken[1e-3] - before == pytest.approx(50, abs=5)
    # and who has left does not hold a place
    before = bench.taken[1e-3]
    bench.run(34.0, {1e-3})
    assert bench.taken[1e-3] - before > 70


def test_every_view_hears_of_lost_pictures_and_asks_again(session: FlightSession) -> None:
    producer = Slow()
    turns = Turns(producer, lambda: producer.now_s)
    settings = ViewSettings(bands="mono", environment=session.scene().environment)
    feeds = [Feed(turns.channel(), lambda: producer.now_s) for _ in range(2)]
    for feed in feeds:
        feed.update(session, settings)
    assert len(producer.asked) == 2
    producer.lose = "the drawing process died"
    for feed in feeds:
        feed.update(session, settings)
    assert [f.restarts for f in feeds] == [1, 1]
    for feed in feeds:
        feed.update(session, settings)
    assert len(producer.asked) == 2


class Failing(Slow):
    """A producer of which the oldest request may fail, as a render process tells it."""

    def __init__(self) -> None:
        super().__init__()
        self.fail: Exception | None = None
        self.done = 0

    def finished(self) -> Iterable[Frame]:
        while self.asked and (self.done or self.fail is not None):
            if self.fail is not None:
                error, self.fail = self.fail, None
                self.asked.pop(0)
                raise error
            self.done -= 1
            yield self.draw()


OUT_OF_MEMORY = RuntimeError(
    "the render process failed: Traceback (most recent call last):\n  ...\nGL_OUT_OF_MEMORY"
)


def test_a_picture_of_a_further_view_that_fails_is_told_and_the_others_go_on(session: FlightSession) -> None:
    producer = Failing()
    turns = Turns(producer, lambda: producer.now_s)
    settings = ViewSettings(bands="mono", environment=session.scene().environment)
    camera = Feed(turns.channel(), lambda: producer.now_s)
    further = Feed(turns.channel(), lambda: producer.now_s, PictureKind(title="orbit camera", needed=False))
    camera.update(session, settings)
    producer.done = 1
    assert camera.update(session, settings)
    for k in range(3):
        session.step(PilotCommand(), 0.1)
        producer.now_s += 3.0
        further.update(session, settings)
        camera.update(session, settings)
        assert len(producer.asked) == 2
        # the further view's is the older one; the camera, which looks first, is not struck by it
        producer.fail, producer.done = OUT_OF_MEMORY, 1
        camera.update(session, settings)
        assert not further.update(session, settings)
        assert camera.update(session, settings)
        assert camera.take_trouble() is None
        told = "no picture of the orbit camera: GL_OUT_OF_MEMORY; the console tries again"
        # the same again and again is told once
        assert further.take_trouble() == (told if k == 0 else None)
        further.update(session, settings)
        assert not further.waiting, "it is not asked for again at once"
    producer.now_s += 3.0
    further.update(session, settings)
    producer.done = 2
    assert further.update(session, settings)
    assert (camera.restarts, further.restarts) == (0, 0)


def test_a_picture_of_the_camera_that_fails_is_told_once_there_was_one(session: FlightSession) -> None:
    producer = Failing()
    feed = Feed(Turns(producer, lambda: producer.now_s).channel(), lambda: producer.now_s)
    settings = ViewSettings(bands="mono", environment=session.scene().environment)
    feed.update(session, settings)
    producer.done = 1
    feed.update(session, settings)
    session.step(PilotCommand(), 0.1)
    feed.ask_to_save()
    producer.now_s += 1.0
    feed.update(session, settings)
    producer.fail = UserError("the graphics memory is full")
    assert not feed.update(session, settings)
    assert feed.take_trouble() == (
        "no picture of the chaser's camera: the graphics memory is full; the picture is not saved"
    )
    assert not feed.saving
    assert feed.newest is not None
    producer.now_s += 3.0
    feed.update(session, settings)
    producer.done = 1
    assert feed.update(session, settings)


@pytest.mark.parametrize(
    "error", [UserError("no OpenGL 4.1"), RuntimeError("no driver"), ProcessDiedError("render process", -9)]
)
def test_a_renderer_that_cannot_be_opened_ends_the_console(session: FlightSession, error: Exception) -> None:
    producer = Failing()
    feed = Feed(Turns(producer, lambda: producer.now_s).channel(), lambda: producer.now_s)
    settings = ViewSettings(bands="mono", environment=session.scene().environment)
    feed.update(session, settings)
    producer.fail = error
    with pytest.raises(UserError):
        feed.update(session, settings)


def test_a_render_process_that_is_gone_for_good_ends_the_console(session: FlightSession) -> None:
    producer = Failing()
    feed = Feed(Turns(producer, lambda: producer.now_s).channel(), lambda: producer.now_s)
    settings = ViewSettings(bands="mono", environment=session.scene().environment)
    feed.update(session, settings)
    producer.done = 1
    feed.update(session, settings)
    session.step(PilotCommand(), 0.1)
    feed.update(session, settings)
    producer.fail = ProcessDiedError("render process", -9)
    with pytest.raises(UserError, match="exit code -9"):
        feed.update(session, settings)


def test_a_further_view_whose_moment_cannot_be_drawn_says_so(session: FlightSession) -> None:
    def nowhere(*_: object) -> SceneState:
        raise ValueError("the free camera is inside the target")

    producer = Failing()
    feed = Feed(
        producer, lambda: producer.now_s, PictureKind(scene=nowhere, title="orbit camera", needed=False)
    )
    assert not feed.update(session, ViewSettings(bands="mono", environment=session.scene().environment))
    assert "inside the target" in (feed.take_trouble() or "")


def test_a_feed_of_labels_asks_for_them_now_and_then_only(session: FlightSession) -> None:
    producer = Slow()
    kind = PictureKind(labels=LabelRequest(layers=("depth",)), every_s=1.0)
    feed = Feed(producer, lambda: producer.now_s, kind)
    settings = ViewSettings(bands="mono", environment=session.scene().environment)
    asked = 0
    for _ in range(30):
        session.step(PilotCommand(), 0.1)
        producer.now_s += 0.1
        feed.update(session, settings)
        if producer.asked:
            asked += 1
            assert producer.asked[-1].labels == LabelRequest(layers=("depth",))
            feed.write(producer.draw())
    assert asked == 3
    assert feed.saved == []
