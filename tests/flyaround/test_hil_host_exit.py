"""``flyaround hil host`` ends with 0 only where a board was there to the end, and accepted a pose."""

import json
import socket
import subprocess
import sys
import threading
import time
from importlib.resources import files
from pathlib import Path

import cv2
import numpy as np
import pytest
from hil_loop import Instant, greeted, serve_by_hand
from hil_processes import children_of, free_url

from flyaround.__main__ import run
from flyaround.hil.board.agent import run_board
from flyaround.hil.host.ledger.frames_csv import read_ledger
from flyaround.hil.link.packets.messages import FrameHeader
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight

pytestmark = pytest.mark.gl

ROOT = Path(__file__).parents[2]


def leaves_in_the_first_frame(url):
    """A board that takes a frame's header and closes the line, without a goodbye."""
    serve_by_hand(greeted(url), lambda message: isinstance(message, FrameHeader))


def test_a_board_that_leaves_for_good_is_no_success(capsys, tmp_path):
    url = free_url()
    board = threading.Thread(target=leaves_in_the_first_frame, args=(url,), daemon=True)
    board.start()
    command = ["hil", "host", "tango-space-10m", "-n", "3", "--truth", "off"]
    command += ["--timeout", "2.5", "--wait", "60", "--json"]
    code = run([*command, "--listen", url, "--log", str(tmp_path / "log")])
    board.join(60.0)
    said = capsys.readouterr()
    assert code == 3
    assert "the board left after 1 of 3 frames" in " ".join(said.err.split())
    summary = json.loads(said.out)
    assert (summary["ended"], summary["sent"], summary["dropped"]) == ("board_lost", 1, {"disconnected": 1})
    assert [row.outcome for row in read_ledger(tmp_path / "log")] == ["dropped:disconnected"]


class DeclinesAll(Instant):
    """An estimator that finds nothing."""

    def estimate(self, image):
        estimate = super().estimate(image)
        estimate.accepted, estimate.reason = False, "nothing seen"
        return estimate


@pytest.mark.parametrize(("words", "code"), [((), 3), (("--allow-none",), 0)])
def test_a_run_without_an_accepted_pose_is_no_success_unless_it_may_be(words, code, capsys, tmp_path):
    write_picture(tmp_path / "pictures")
    url = free_url()
    options = {"make_estimator": DeclinesAll, "silence_s": 60.0, "connect_timeout_s": 60.0}
    board = threading.Thread(target=run_board, args=(url,), kwargs=options, daemon=True)
    board.start()
    command = f"hil host tango-space-10m -n 2 --truth off --silence 60 --listen {url}".split()
    assert run([*command, "--from", str(tmp_path / "pictures"), "--deadline", "50", *words]) == code
    board.join(60.0)
    said = capsys.readouterr()
    assert "no pose was accepted in 2 frames" in " ".join(said.err.split())
    assert "not answered within the deadline of 50000 ms: 0" in " ".join(said.out.split())


def write_picture(folder):
    folder.mkdir()
    camera = plan_flight(load_scenario("tango-space-10m"), n=1).camera
    cv2.imwrite(str(folder / "000000.png"), np.zeros((camera.height_px, camera.width_px), np.uint8))


def test_what_listens_says_so_and_waits_no_longer_than_it_is_told(capsys, tmp_path):
    url = free_url("0.0.0.0")  # noqa: S104 - the address in question
    command = ["hil", "host", "tango-space-10m", "-n", "2", "--truth", "inline", "--timeout", "0.2"]
    # to everybody, so that whoever connects must prove something
    assert run([*command, "--listen", url, "--log", str(tmp_path / "log")]) == 2
    assert "give both sides a key" in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "log").exists()
    key = tmp_path / "key"
    assert run(["hil", "key", str(key)]) == 0
    assert key.stat().st_mode & 0o777 == 0o600
    assert run(["hil", "key", str(key)]) == 2
    capsys.readouterr()
    command += ["--key", str(key)]
    start = time.monotonic()
    assert run([*command, "--listen", url, "--log", str(tmp_path / "log")]) == 2
    # the first frame is drawn meanwhile; a minute is what it once waited at least
    assert time.monotonic() - start < 55.0
    said = capsys.readouterr().err.splitlines()
    port = url.rsplit(":", 1)[1]
    where = f"tcp://{socket.gethostname()}:{port}"
    assert said[0] == f"listening on {url}; on the board type"
    assert said[1].strip() == f"flyaround hil board {where} --target tango --key FILE"
    assert said[3].strip() == f"python3 board.pyz {where} --model tango --key FILE"
    assert said[-1].startswith(f"flyaround: no board connected to {where} within 0.2 s")
    assert f"start one with `flyaround hil board {where} --target tango --key FILE`" in said[-1]
    record = json.loads((tmp_path / "log" / "run.json").read_text())
    assert record["truth"] == "inline"
    assert record["command"][:3] == ["flyaround", "hil", "host"]
    assert key.read_text().strip() not in (tmp_path / "log" / "run.json").read_text()
    assert json.loads((tmp_path / "log" / "summary.json").read_text())["ended"] == "no_board"


def alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def test_a_terminated_host_closes_its_books_and_leaves_nothing_behind(tmp_path):
    url, log = free_url(), tmp_path / "log"
    command = [sys.executable, "-m", "flyaround", "hil", "host", "tango-space-10m", "-n", "500"]
    host = subprocess.Popen(
        [*command, "--listen", url, "--truth", "off", "--silence", "60", "--log", str(log)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    )
    try:
        assert host.stderr.readline() == f"listening on {url}; on the board type\n"
        ended = []
        board = threading.Thread(
            target=lambda: ended.append(run_board(url, make_estimator=Instant, silence_s=60.0)), daemon=True
        )
        board.start()
        deadline = time.monotonic() + 120.0
        while not (log / "frames.csv").exists() or (log / "frames.csv").read_text().count("\n") < 3:
            assert time.monotonic() < deadline, host.poll()
            time.sleep(0.05)
        # in mid-frame of the one that draws, and twice, as `timeout` does it
        children = children_of(host.pid)
        assert len(children) >= 2
        host.terminate()
        host.terminate()
        start = time.monotonic()
        out, err = host.communicate(timeout=60.0)
        # two seconds are what children were left for; ten times what an idle machine takes
        assert time.monotonic() - start < 20.0
        # one of them is Python's own, which frees what others leave and ends last
        deadline = time.monotonic() + 20.0
        while any(alive(pid) for pid in children):
            assert time.monotonic() < deadline
            time.sleep(0.05)
    finally:
        host.kill()
        host.communicate()
    board.join(60.0)
    assert host.returncode == 143
    assert err.splitlines()[-1] == "flyaround: terminated; files written so far are complete"
    assert "leaked" not in err
    summary = json.loads((log / "summary.json").read_text())
    rows = read_ledger(log)
    assert summary["ended"] == "interrupted"
    assert summary["sent"] == len(rows) >= 2
    # a person is told in words, JSON is for --json
    assert out.startswith(f"{len(rows)} frames sent: {summary['accepted']} accepted, ")
    assert "{" not in out
    assert "the run was stopped at the host" in ended[0].ended


def test_colour_as_grey_is_refused_before_anybody_listens(capsys, tmp_path):
    text = (files("flyaround.assets.scenarios") / "tango-space-10m.toml").read_text()
    colour = tmp_path / "colour.toml"
    colour.write_text(text.replace('bands = "mono"', 'bands = "rgb"'))
    command = ["hil", "host", str(colour), "--pixel-format", "mono8", "--log", str(tmp_path / "log")]
    assert run(command) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "colour pictures of 8 bits do not fit the pixel format Mono8: choose RGB8" in said
    assert "listening" not in said
    assert not (tmp_path / "log").exists()


@pytest.mark.parametrize("command", [["hil", "host"], ["fly", "-o", "x"], ["render", "-o", "x.png"], ["sim"]])
def test_a_recipe_is_told_from_a_scenario(capsys, monkeypatch, tmp_path, command):
    monkeypatch.chdir(tmp_path)
    assert run([*command, "eval-black"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    name = " ".join(word for word in command if word in {"hil", "host", "fly", "render", "sim"})
    assert f"eval-black is a recipe of independent samples, and {name} takes a scenario" in said
    assert "flyaround capture eval-black" in said


@pytest.mark.parametrize("command", ["host", "board"])
def test_help_names_the_serial_line(capsys, command):
    assert run(["hil", command, "--help"]) == 0
    assert "serial:///dev/ttyUSB0?baud=921600" in capsys.readouterr().out
