"""Progress of preparations is read in another process, step by step."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future
from typing import Any, Self

import pytest

from flyaround.simulator.runtime import progress
from flyaround.simulator.runtime.progress import ProgressLine, publish_progress, watch_steps
from flyaround.simulator.runtime.worker import WorkerProcess


@pytest.fixture
def line(monkeypatch: pytest.MonkeyPatch) -> Iterator[ProgressLine]:
    monkeypatch.setattr(progress, "_reporter", type(progress._reporter)())
    made = ProgressLine()
    publish_progress(made)
    return made


def test_each_step_that_ends_moves_the_line_on(line: ProgressLine) -> None:
    maps, terrain = Future[Any](), Future[Any]()
    assert line.read() == "the renderer"
    watch_steps({"maps": maps, "terrain": terrain})
    assert line.read() == "maps, 1 of 3"
    maps.set_result(None)
    assert line.read() == "terrain, 2 of 3"
    terrain.set_exception(ValueError())
    assert line.read() == "picture, 3 of 3"
    watch_steps({"air": Future()})
    assert line.read() == "air, 1 of 2"


def test_steps_that_begin_later_are_counted_with_those_that_wait(line: ProgressLine) -> None:
    watch_steps({"maps": Future()})
    watch_steps({"light": Future()})
    assert line.read() == "maps, 1 of 3"


def test_a_text_that_is_too_long_is_cut(line: ProgressLine) -> None:
    line.write("å" * 200)
    assert set(line.read()) == {"å"}


def test_nobody_need_read_it() -> None:
    assert ProgressLine().read() == ""
    watch_steps({"maps": Future()})


class Told:
    """A resource of a process that tells of one step."""

    info = "ready"

    def __init__(self, line: ProgressLine) -> None:
        self.line = line

    def __call__(self) -> Told:
        publish_progress(self.line)
        watch_steps({"terrain": Future()})
        return self

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass


def doubled(_: Told, number: int) -> int:
    return 2 * number


def test_the_line_of_another_process_is_read_here() -> None:
    line = ProgressLine()
    with WorkerProcess(doubled, open_resource=Told(line)) as process:
        process.submit(21)
        assert process.result() == 42
        assert line.read() == "terrain, 1 of 2"
