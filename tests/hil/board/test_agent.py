"""The board's agent when its estimator hangs, its host goes away, or it is stopped: nothing stale, codes that tell."""

import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from estimators import Instant, Stuck
from hand_made_host import HandMadeHost, hand_made_host, in_thread, leave_with_a_goodbye
from hil_loop import Loop, adds_up, board, frames
from programs import completed

from flyaround.hil.board import agent as agent_module
from flyaround.hil.board.__main__ import main
from flyaround.hil.board.agent import BoardAgent, run_board
from flyaround.hil.board.service import ExitCode, ServiceManager, systemd_unit
from flyaround.hil.link.errors import LinkError
from flyaround.hil.link.packets.messages import Bye, ErrorMessage, PoseMessage, TimeSyncReply

ROOT = Path(__file__).parents[3]
PATIENCE_S = 60.0


@pytest.fixture(autouse=True)
def _release():
    Stuck.released.clear()
    yield
    Stuck.released.set()


@pytest.mark.parametrize(
    "limit", [{"watchdog_s": float("nan")}, {"silence_s": float("nan")}, {"silence_s": 0.0}, {"window": 0}]
)
def test_a_limit_that_nothing_exceeds_is_refused(limit):
    (name,) = limit
    with pytest.raises(LinkError, match=f"{name} is"):
        BoardAgent("tcp://127.0.0.1:9", make_estimator=Instant, **limit)


# --- the watchdog ------------------------------------------------------------------------------


def test_the_watchdog_declines_the_frame_and_clocks_are_answered_meanwhile():
    with hand_made_host() as host:
        thread, ended = in_thread(lambda: run_board(host.url, make_estimator=Stuck, watchdog_s=2.5))
        host.meet()
        host.send_frame(1, level=3)
        assert host.pose().t_camera_from_target_m == (0.0, 0.0, 3.0)
        host.send_frame(2, level=7)
        heard = []
        for _ in range(3):
            host.ask_clock()
            heard.append(host.hear((TimeSyncReply, PoseMessage)))
        assert all(isinstance(reply, TimeSyncReply) for reply in heard)
        pose = host.pose()
        assert (pose.frame_id, pose.accepted) == (2, False)
        assert pose.reason == "the watchdog stopped the estimator, which took longer than 2.5 s"
        assert pose.end_ns - pose.start_ns >= 2_500_000_000
        assert "watchdog" in host.hear(Bye).reason
        thread.join(PATIENCE_S)
    (summary,) = ended
    assert (summary.hung, summary.busy, summary.goodbye, summary.frames) == (True, True, False, 2)


def test_a_hung_estimator_costs_its_frame_alone_where_the_board_starts_again():
    def starts_again(url):
        summary = board(Stuck, watchdog_s=1.0)(url)
        Stuck.released.set()
        return summary.hung and board()(url)

    rows = []
    loop = Loop(starts_again)
    summary = loop.run(frames(12), on_row=rows.append)
    assert summary.ended == "completed"
    assert adds_up(summary)
    assert rows[7].outcome == "declined"
    assert "watchdog" in rows[7].reason
    # the one that was sent before the board had said goodbye
    lost = [row.frame_id for row in rows if row.outcome.startswith("dropped")]
    assert lost in ([], [8])
    assert summary.accepted == 11 - len(lost)


# --- meeting the next host -----------------------------------------------------------------------


class StopAgent(Exception):  # noqa: N818 - no error
    """The test has seen enough."""


def test_a_board_that_lost_its_host_meets_the_next_and_brings_nothing_along():
    pauses, sentences, agents = [], [], []

    def pause(seconds):
        pauses.append(seconds)
        if Stuck.released.is_set() and len(sentences) >= 3:
            raise StopAgent
        time.sleep(0.2 * seconds)

    def until_stopped(url):
        agent = BoardAgent(url, make_estimator=Slow, connect_timeout_s=PATIENCE_S)
        agents.append(agent)
        try:
            agent.serve_repeatedly(sentences.append, pause)
        except StopAgent:
            return "stopped"

    class Slow(Stuck):
        def estimate(self, image):
            time.sleep(0.2)
            return super().estimate(image)

    first = HandMadeHost()
    thread, result = in_thread(until_stopped, first.url)
    first.meet()
    first.send_frame(1, level=1)
    first.vanish()  # while the estimator is at work
    first.meet()
    first.send_frame(1, level=2)
    pose = first.pose()
    # the answer to its own frame, not to the one of that number before
    assert pose.t_camera_from_target_m == (0.0, 0.0, 2.0)
    # where somebody is there, he may be slow to answer
    agents[0]._timeout_s = 0.1
    first.close()
    # nobody there for a while: tried again with pauses that grow, and are bounded
    deadline = time.monotonic() + PATIENCE_S
    while len(pauses) < 6 and time.monotonic() < deadline:
        time.sleep(0.02)
    agents[0]._timeout_s = PATIENCE_S
    with hand_made_host(first.url) as second:
        second.meet()
        second.send_frame(9, level=4)
        assert second.pose().t_camera_from_target_m == (0.0, 0.0, 4.0)
        Stuck.released.set()
        second.link.close("the run is over")
        thread.join(PATIENCE_S)
    assert result == ["stopped"]
    assert max(pauses) <= agent_module.MAX_BACKOFF_S * 1.25
    assert max(pauses[2:6]) > 4 * min(pauses)
    assert "went away without a goodbye" in sentences[0]
    # the same reason again and again is said once
    assert sum("nobody listens" in sentence for sentence in sentences) <= 2
    assert "the run is over" in sentences[-1]


def test_a_goodbye_is_heard_though_the_host_hears_nothing_any_more():
    with hand_made_host() as host:
        thread, ended = in_thread(lambda: run_board(host.url, make_estimator=Instant))
        host.meet()
        leave_with_a_goodbye(host)
        thread.join(PATIENCE_S)
    assert ended[0].goodbye, ended[0].ended


def test_a_host_that_says_nothing_any_more_is_gone():
    """Unplugged: no end of file comes, and nothing else either. It never answered, so it is waited for longer."""
    with hand_made_host() as host:
        thread, ended = in_thread(lambda: run_board(host.url, make_estimator=Instant, silence_s=0.5))
        host.meet()
        host.send_frame(1)
        host.pose()
        thread.join(PATIENCE_S)
    assert not ended[0].goodbye
    assert "said nothing for 2.5 s: it hangs, or the line is cut after 1 frames" in ended[0].ended


def test_an_estimator_that_cannot_start_is_named_as_the_cause():
    def broken(camera):
        return camera.fx_px

    def served(url):
        with pytest.raises(LinkError) as error:
            run_board(url, make_estimator=broken)
        return str(error.value)

    with hand_made_host() as host:
        thread, ended = in_thread(served, host.url)
        host.meet()
        assert "estimator cannot start (AttributeError" in host.hear(ErrorMessage).text
        thread.join(PATIENCE_S)
    assert "make_estimator" in ended[0]


# --- exit codes ------------------------------------------------------------------------------------


@pytest.fixture
def stub(monkeypatch):
    """The program with an estimator that does nothing, and its arguments."""
    monkeypatch.setattr(agent_module, "estimator_factory", lambda _model, _method: (Stuck, "tango", ""))
    return lambda url, *more: main([url, "--model", "any", "--timeout", "30", *more])


def a_host_that(*, level=3, goodbye=True):
    """A host with one frame."""
    host = HandMadeHost()

    def serve():
        host.meet()
        host.send_frame(1, level=level)
        host.pose()
        if goodbye:
            host.link.close("the run is over")
        host.close()

    thread, _ = in_thread(serve)
    return host.url, thread


def test_the_end_is_told_by_the_exit_code(stub, capsys):
    url, thread = a_host_that()
    assert stub(url) == ExitCode.ORDERLY == 0
    thread.join(PATIENCE_S)
    assert "the run is over) after 1 frames: 1 of 1 poses accepted" in capsys.readouterr().out
    url, thread = a_host_that(goodbye=False)
    assert stub(url) == ExitCode.HOST_VANISHED == 1
    thread.join(PATIENCE_S)
    url, thread = a_host_that(level=7)
    assert stub(url, "--watchdog", "0.3") == ExitCode.WATCHDOG == 3
    thread.join(PATIENCE_S)
    assert "the watchdog stopped the estimator" in capsys.readouterr().out
    # nobody listens there any more
    assert stub(url, "--timeout", "0.1") == ExitCode.NO_SESSION == 4
    said = capsys.readouterr().err
    assert said.startswith("nobody listens on tcp://127.0.0.1:")
    assert said.count("\n") == 1


@pytest.mark.parametrize("url", ["http://x", "tcp://127.0.0.1", "serial://?baud=-3"])
def test_a_bad_url_is_a_mistake_and_is_not_tried_again(stub, capsys, url):
    assert stub(url, "--reconnect") == ExitCode.MISTAKE == 2
    assert capsys.readouterr().err.count("\n") == 1


# The program in a process of its own, with the estimator of this file.
PROGRAM = f"""
import sys
sys.path.insert(0, {str(ROOT / "tests" / "harness")!r})
from estimators import Stuck
from flyaround.hil.board import agent
agent.estimator_factory = lambda model, method: (Stuck, "tango", "")
from flyaround.hil.board.__main__ import run_and_exit
run_and_exit("flyaround.hil.board")
"""


def program(url, *more, **options):
    command = [sys.executable, "-c", PROGRAM, url, "--model", "any", *more]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT, **options
    )


def test_a_hung_board_starts_anew_in_its_own_process_and_is_stopped_by_a_signal():
    with hand_made_host() as host:
        agent = program(host.url, "--reconnect", "--watchdog", "2.5")
        try:
            host.meet(PATIENCE_S)
            host.send_frame(1, level=7)
            assert "watchdog" in host.pose().reason
            host.hear(Bye)
            # the same process, whose number a service manager knows, with nothing of the thread that is stuck
            host.meet(PATIENCE_S)
            assert agent.poll() is None
            host.send_frame(1, level=5)
            assert host.pose().t_camera_from_target_m == (0.0, 0.0, 5.0)
            host.send_frame(2, level=7)
            time.sleep(0.1)
            # in the middle of a frame that it does not come back from
            agent.send_signal(signal.SIGTERM)
            start = time.monotonic()
            assert host.hear(Bye).reason == "the board's agent ends"
            _, said = agent.communicate(timeout=PATIENCE_S)
            took = time.monotonic() - start
        finally:
            agent.kill()
            agent.communicate()
    assert agent.returncode == ExitCode.TERMINATED == 143
    # two seconds at most where the machine is idle
    assert took < 20.0
    assert (
        "the watchdog stopped the estimator, which took longer than 2.5 s after 1 frames; the agent restarts"
        in said
    )
    assert said.splitlines()[-1] == "terminated"


def test_ctrl_c_has_a_code_of_its_own():
    with hand_made_host() as host:
        agent = program(host.url, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler))
        try:
            host.meet(PATIENCE_S)
            agent.send_signal(signal.SIGINT)
            _, said = agent.communicate(timeout=PATIENCE_S)
        finally:
            agent.kill()
            agent.communicate()
    assert (agent.returncode, said) == (ExitCode.INTERRUPTED, "stopped from the keyboard\n")
    assert ExitCode.INTERRUPTED == 130


# --- the service manager --------------------------------------------------------------------------


@pytest.fixture
def notified(monkeypatch):
    """The socket that a service manager listens on."""
    path = f"/tmp/flyaround-notify-{os.getpid()}"  # noqa: S108 - a socket's name must be short
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as line:
        line.bind(path)
        heard: list[str] = []
        # a queue of ten takes no more
        threading.Thread(
            target=lambda: heard.extend(iter(lambda: line.recv(4096).decode(), "")), daemon=True
        ).start()
        monkeypatch.setenv("NOTIFY_SOCKET", path)
        monkeypatch.setenv("WATCHDOG_USEC", "150000")
        yield heard
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as last:
            last.sendto(b"", path)
    Path(path).unlink()


def comes(what, heard):
    """Whether a word comes in time."""
    deadline = time.monotonic() + PATIENCE_S
    while what not in heard and time.monotonic() < deadline:
        time.sleep(0.02)
    return what in heard


def test_the_service_manager_hears_that_the_agent_is_ready_and_alive(stub, notified):
    url, thread = a_host_that(level=7)
    assert stub(url, "--watchdog", "2.5") == ExitCode.WATCHDOG
    thread.join(PATIENCE_S)
    assert comes("STOPPING=1", notified)
    assert "READY=1" in notified
    assert notified.count("WATCHDOG=1") >= 2


def test_an_agent_that_is_not_well_is_silent(notified):
    manager, well = ServiceManager(), threading.Event()
    manager.start_heartbeat(well.is_set)
    time.sleep(0.4)
    assert notified == []
    well.set()
    assert comes("WATCHDOG=1", notified)
    manager.close()


def test_the_unit_runs_the_agent_as_a_user_of_its_own(capsys, tmp_path):
    command = ["tcp://192.168.1.2:5600", "--model", "a name.board.json", "--systemd-unit"]
    assert main(command) == 0
    unit = capsys.readouterr().out
    (start,) = [line for line in unit.splitlines() if line.startswith("ExecStart=")]
    assert start.endswith(" tcp://192.168.1.2:5600 --model 'a name.board.json' --reconnect --watchdog 60")
    for line in (
        "User=flyaround",
        "Restart=on-failure",
        "Type=notify",
        "NoNewPrivileges=yes",
        "PrivateDevices=yes",
    ):
        assert line in unit.splitlines()
    serial = systemd_unit("/opt/board.pyz", ["x"], "serial:///dev/ttyUSB0?baud=921600")
    assert "DeviceAllow=/dev/ttyUSB0 rw" in serial
    assert "PrivateDevices" not in serial
    analyse = shutil.which("systemd-analyze")
    if analyse is not None:
        path = tmp_path / "flyaround-board.service"
        path.write_text(unit)
        done = completed(analyse, "verify", path)
        assert "Unknown" not in done.stderr
