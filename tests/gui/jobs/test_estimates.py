"""The estimator beside the flight: real processes that answer, hang, die and refuse; the window never waits."""

from __future__ import annotations

import contextlib
import os
import signal
import time
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Self

import numpy as np
import pytest

from flyaround.gui.jobs.estimates import ComparedEstimate, Estimates, compared
from flyaround.gui.jobs.estimator_process import Answer, EstimateRequest, EstimatorCache, _network
from flyaround.gui.picture.feed import Picture
from flyaround.gui.texts import texts
from flyaround.simulator.camera.lens.camera_model import Camera, reduced_camera
from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.errors import UserError
from flyaround.simulator.frame import NO_RADIANCE, Frame
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.runtime.worker_pool import MAX_CONSECUTIVE_DEATHS
from flyaround.simulator.scenario.load import load_scenario
from tests.harness.turned_clock import TurnedClock

WAIT_S = 120.0
NO_WAIT_S = 4.5
"""A turn that starts a process on a busy machine takes less."""


class Held:
    """What the tests' process holds."""

    info = "ready"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass


def answer_of(request: EstimateRequest, **changes: object) -> Answer:
    fields: dict[str, object] = {
        "accepted": True,
        "reason": "",
        "q_camera_from_target_wxyz": (1.0, 0.0, 0.0, 0.0),
        "t_camera_from_target_m": (0.0, 0.0, 10.0),
        "confidence": 0.9,
        "stages_ms": {request.method: 2.0},
    }
    return Answer(**{**fields, **changes})  # type: ignore[arg-type]


def answers(_held: Held, request: EstimateRequest) -> Answer:
    return answer_of(request)


def hangs(_held: Held, request: EstimateRequest) -> Answer:
    if request.method == "hangs":
        time.sleep(600)
    return answer_of(request)


def dies(_held: Held, request: EstimateRequest) -> Answer:
    if request.method == "dies":
        os._exit(7)
    return answer_of(request)


def refuses(_held: Held, request: EstimateRequest) -> Answer:
    if request.method == "breaks":
        raise ValueError("nothing of the kind")
    raise UserError(f"there is no method {request.method}")


@pytest.fixture(scope="module")
def session() -> FlightSession:
    return FlightSession.of(load_scenario("tango-flyaround"))


def picture_of(session: FlightSession, t_s: float = 0.0, size: int = 64) -> Picture:
    scene = session.scene()
    camera = replace(reduced_camera(scene.camera, 8), width_px=size, height_px=size)
    scene = replace(scene, t_s=t_s, camera=camera)
    frame = Frame(scene, np.full((size, size), 7, np.uint8), NO_RADIANCE)
    return Picture(frame, session.state, session.plan.target, 8)


def until(done: Callable[[], bool], turn: Callable[[], object]) -> float:
    """Turn the loop until something is so; the longest turn is returned [s]."""
    longest, end = 0.0, time.monotonic() + WAIT_S
    while not done():
        assert time.monotonic() < end, "it did not come"
        start = time.perf_counter()
        turn()
        longest = max(longest, time.perf_counter() - start)
        time.sleep(0.002)
    return longest


def test_an_estimate_goes_with_its_camera_and_stays_at_another_detail(session: FlightSession) -> None:
    with contextlib.closing(Estimates(open_resource=Held, work=answers)) as estimates:
        estimates.start()
        one = picture_of(session, 1.0)
        until(lambda: estimates.newest is not None, lambda: estimates.update(one))
        scene = session.scene()

        def seen(camera: Camera, divisor: int) -> Picture:
            frame = replace(one.frame, scene=replace(scene, t_s=1.5, camera=reduced_camera(camera, divisor)))
            return replace(one, frame=frame, divisor=divisor)

        estimates.stop()
        for divisor in (1, 2, 3, 8):
            estimates.update(seen(scene.camera, divisor))
            assert estimates.newest is not None, divisor
        estimates.update(seen(load_camera("fisheye-140"), 2))
        assert estimates.newest is None


def test_until_the_first_estimate_the_step_of_its_preparation_is_told(session: FlightSession) -> None:
    clock = TurnedClock()
    with contextlib.closing(Estimates(open_resource=Held, work=answers, clock=clock)) as estimates:
        estimates.start()
        picture = picture_of(session, 1.0)
        estimates.update(picture)
        estimates.progress.write("tables of the target, 4 of 5")
        clock.pass_s(34.0)
        assert estimates.doing == "preparing tables of the target, 4 of 5, 34 s"
        until(lambda: estimates.newest is not None, lambda: estimates.update(picture))
        assert "preparing" not in estimates.doing


def test_the_process_tells_each_step_once(session: FlightSession) -> None:
    class Line:
        def __init__(self) -> None:
            self.texts: list[str] = []

        def write(self, text: str) -> None:
            self.texts.append(text)

    scene, line = session.scene(), Line()
    image = np.zeros((4, 4), np.uint8)
    request = EstimateRequest(
        method="svd-2018", camera=scene.camera, target=scene.target, image=image, t_s=0.0, stages=False
    )
    with EstimatorCache(line) as cache:  # type: ignore[arg-type]
        assert cache.estimator(request) is cache.estimator(request)
    assert [text.rpartition(", ")[2] for text in line.texts] == [f"{k} of 6" for k in range(2, 7)]


def test_one_picture_at_a_time_and_the_newest(session: FlightSession) -> None:
    with contextlib.closing(Estimates(open_resource=Held, work=answers)) as estimates:
        assert not estimates.update(picture_of(session))
        assert estimates.state == "off"
        estimates.start()
        for t_s in (1.0, 2.0, 3.0):
            newest = picture_of(session, t_s)
            until(
                lambda t=t_s: estimates.newest is not None and estimates.newest.t_s == t,
                lambda p=newest: estimates.update(p),
            )
        # a picture is estimated once
        for _ in range(20):
            estimates.update(newest)
            time.sleep(0.005)
        assert [e.t_s for e in estimates.history] == [1.0, 2.0, 3.0]
        assert estimates.take_troubles() == []
        estimates.update(picture_of(session, 0.5))
        until(lambda: estimates.newest.t_s == 0.5, lambda: estimates.update(None))
        assert [e.t_s for e in estimates.history] == [0.5], "time that goes back begins the plots again"


def test_errors_are_against_the_truth_of_the_picture(session: FlightSession) -> None:
    picture = picture_of(session)
    scene = picture.frame.scene
    request = EstimateRequest(
        method="x",
        camera=scene.camera,
        target=scene.target,
        image=picture.frame.image,
        t_s=0,
        stages=False,
    )
    t = np.add(scene.t_camera_from_target_m, (0.03, 0.0, 0.04))
    answer = answer_of(
        request, q_camera_from_target_wxyz=scene.q_camera_from_target_wxyz, t_camera_from_target_m=tuple(t)
    )
    estimate = compared(picture, "x", answer, 1.0)
    assert estimate.E_R_deg == pytest.approx(0.0, abs=1e-6)
    assert estimate.E_T_m == pytest.approx(0.05)
    none = compared(picture, "x", answer_of(request, q_camera_from_target_wxyz=None), 1.0)
    assert none.E_R_deg is None
    broken = compared(picture, "x", answer_of(request, t_camera_from_target_m=(np.nan, 0, 1)), 1.0)
    assert broken.E_T_m is None


def test_one_that_hangs_is_ended_and_another_method_goes_on(session: FlightSession) -> None:
    clock = TurnedClock()
    with contextlib.closing(Estimates(open_resource=Held, work=hangs, clock=clock)) as estimates:
        estimates.start()
        estimates.choose("hangs")
        picture = picture_of(session)
        until(lambda: estimates.state == "at work", lambda: estimates.update(picture))
        longest = until(
            lambda: estimates.restarts > 0, lambda: (clock.pass_s(1.0), estimates.update(picture))
        )
        assert longest < NO_WAIT_S, "the window waited"
        (told,) = estimates.take_troubles()
        assert "done nothing" in told
        assert "flight continues" in told
        estimates.choose("hybrid")
        until(lambda: estimates.newest is not None, lambda: estimates.update(picture))


@pytest.mark.slow
def test_a_stopped_process_holds_nobody_up(session: FlightSession) -> None:
    clock = TurnedClock()
    estimates = Estimates(open_resource=Held, work=answers, clock=clock)
    with contextlib.closing(estimates):
        estimates.start()
        first = picture_of(session, 1.0, 512)
        until(lambda: estimates.newest is not None, lambda: estimates.update(first))
        assert estimates.pid is not None
        os.kill(estimates.pid, signal.SIGSTOP)
        second = picture_of(session, 2.0, 512)
        longest = until(lambda: estimates.state == "at work", lambda: estimates.update(second))
        turns = until(lambda: estimates.restarts == 1, lambda: (clock.pass_s(1.0), estimates.update(second)))
        longest = max(longest, turns)
        assert longest < NO_WAIT_S, "the window waited"
        until(lambda: estimates.newest.t_s == 2.0, lambda: estimates.update(second))


@pytest.mark.slow
def test_one_that_dies_again_and_again_is_left_off(session: FlightSession) -> None:
    with contextlib.closing(Estimates(open_resource=Held, work=dies)) as estimates:
        estimates.choose("dies")
        estimates.start()
        picture = picture_of(session)
        until(lambda: not estimates.on, lambda: estimates.update(picture))
        told = estimates.take_troubles()
        assert len(told) == MAX_CONSECUTIVE_DEATHS
        assert "exit code 7" in told[0]
        assert "is off" in told[-1]
        estimates.choose("hybrid")
        estimates.start()
        until(lambda: estimates.newest is not None, lambda: estimates.update(picture))


@pytest.mark.parametrize(
    ("method", "why"), [("breaks", "nothing of the kind"), ("no-such", "no method no-such")]
)
def test_a_method_that_cannot_is_off_with_a_sentence(session: FlightSession, method: str, why: str) -> None:
    with contextlib.closing(Estimates(open_resource=Held, work=refuses)) as estimates:
        estimates.choose(method)
        estimates.start()
        picture = picture_of(session)
        until(lambda: not estimates.on, lambda: estimates.update(picture))
        (told,) = estimates.take_troubles()
        assert why in told
        assert "\n" not in told
        estimates.update(picture)
        assert estimates.doing == told, "it stays until the next start or choice"
        estimates.start()
        assert estimates.doing == "starting"


@pytest.mark.parametrize(
    ("learned", "own", "name"), [(None, None, "none"), (1, None, "shipped"), (1, "x", "own")]
)
def test_an_answer_names_the_network_that_took_part(learned: object, own: str | None, name: str) -> None:
    hybrid = SimpleNamespace(setup=SimpleNamespace(learned=learned), model=SimpleNamespace(network=own))
    assert _network(hybrid) == name
    assert _network(SimpleNamespace(first=hybrid, model=hybrid.model)) == name
    assert _network(SimpleNamespace(model=hybrid.model)) == ""


@pytest.mark.slow
def test_the_estimators_themselves_answer_with_their_stages(session: FlightSession) -> None:
    from flyaround.simulator.dataset.single_frames import render_scene

    scene = replace(session.scene(), camera=reduced_camera(session.plan.camera, 2), quality="draft")
    frame = render_scene(scene, session.plan.target)
    picture = Picture(frame, session.state, session.plan.target, 2)
    found: dict[str, ComparedEstimate] = {}
    with contextlib.closing(Estimates()) as estimates:
        estimates.send_stages(on=True)
        estimates.start()
        for method in ("hybrid", "svd-thesis", "svd-2018", "hybrid-track"):
            estimates.choose(method)
            until(
                lambda m=method: estimates.newest is not None and estimates.newest.method == m,
                lambda: estimates.update(picture),
            )
            assert estimates.newest is not None
            found[method] = estimates.newest
        estimates.choose("net:no-such-file.npz")
        until(lambda: not estimates.on, lambda: estimates.update(picture))
        (told,) = estimates.take_troubles()
        assert "no-such-file" in told
    assert [found[m].answer.network for m in ("hybrid", "hybrid-track", "svd-2018")] == [
        "shipped",
        "shipped",
        "",
    ]
    svd = found["hybrid"]
    assert svd.answer.accepted
    assert svd.E_R_deg is not None
    assert svd.E_R_deg < 1.0
    assert {"gradient", "region", "learned_proposal", "overlay"} <= set(svd.answer.stages)
    assert {"histogram", "groups"} <= set(found["svd-thesis"].answer.stages)
    named = set(texts("stages"))
    assert all(set(one.answer.stages) <= named for one in found.values()), "each stage has words for people"
