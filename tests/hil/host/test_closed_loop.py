"""A closed loop from the command line; once with the real board, each frame drawn of what was flown."""

import csv
import json
import socket
import subprocess
import sys

import pytest
from programs import completed

from flyaround.hil.host.ledger.frames_csv import read_ledger
from flyaround.hil.host.report import write_report
from flyaround.simulator.errors import UserError

FLYAROUND = (sys.executable, "-m", "flyaround")


def run(*words):
    return completed(*FLYAROUND, "hil", "host", *words)


def test_without_a_board_it_writes_figures_and_every_decision(tmp_path):
    log = tmp_path / "log"
    done = run(
        "tango-vbar-closed-loop",
        "--closed-loop",
        "--pose",
        "noisy",
        "--seed",
        "2",
        "--log",
        str(log),
        "--json",
    )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)["closed_loop"]
    assert told == json.loads((log / "summary.json").read_text())["closed_loop"]
    assert told["outcome"] == "arrived"
    assert told["pose"] == "noisy"
    assert told["final_error_m"] < 0.2
    assert told["final_error_deg"] < 2.0
    assert 2.5 < told["min_range_m"] < 3.1
    assert told["keep_out_violations"] == 0
    assert told["delta_v_m_s"] > 0.1
    rows = list(csv.DictReader((log / "closed_loop.csv").read_text().splitlines()))
    assert (rows[0]["phase"], rows[-1]["phase"]) == ("acquire", "arrived")
    assert rows[0]["reason"] == "no pose yet"
    page = write_report(log).read_text()
    assert "<b>arrived</b><span>approach</span>" in page
    assert "closed_loop.csv" in page
    assert "frames.csv" not in page
    (log / "closed_loop.csv").write_text(
        (log / "closed_loop.csv").read_text().replace("acquire,", "acquire,,", 1)
    )
    with pytest.raises(UserError, match="is damaged"):
        write_report(log)


def test_faults_of_the_line_delay_and_lose_poses_without_a_board(tmp_path):
    def flown(text):
        faults, log = tmp_path / "faults.toml", tmp_path / f"log{len(text)}"
        faults.write_text(text)
        done = run(
            "tango-vbar-closed-loop",
            *("--closed-loop", "--pose", "truth", "--faults", str(faults), "--log", str(log)),
        )
        table = log / "closed_loop.csv"
        return done, list(csv.DictReader(table.read_text().splitlines())) if table.exists() else []

    late, rows = flown('[[line]]\nkind = "delay"\ndelay_ms = 2000.0\n')
    assert late.returncode == 0, late.stderr
    # the fifth, of 4 s, is there at the first decision after 6.3 s, and from then on the newest is three seconds old
    assert [row["pose_age_s"] for row in rows[:9]] == [*[""] * 7, "3", "3"]
    lost, rows = flown('[[line]]\nkind = "drop"\nchance = 1.0\nstart_s = 100.0\nend_s = 110.0\n')
    assert lost.returncode == 0, lost.stderr
    assert {row["phase"] for row in rows[106:111]} == {"hold"}
    refused, _ = flown('[[camera]]\nkind = "frozen"\n')
    assert refused.returncode == 2
    assert "'frozen' needs a board" in " ".join(refused.stderr.split())


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--pose", "noisy"), "needs --closed-loop"),
        (("--closed-loop", "--pose", "guess"), "--pose is 'guess', allowed: board, noisy, truth"),
        (("--closed-loop", "-n", "5"), "give --every instead of -n"),
        (("--closed-loop", "--workers", "2"), "leave out --workers"),
        (("--closed-loop", "--pose", "truth", "--mcap", "x.mcap"), "--mcap applies to a board"),
        (("--closed-loop", "--pose", "noisy", "--key", "none"), "--key applies to a board"),
        (("--closed-loop", "--pose", "truth", "--truth", "off"), "--truth applies to a board"),
        (
            ("--closed-loop", "--pose", "truth", "--every", "0.5"),
            "not a multiple of the thrusters' control period",
        ),
    ],
)
def test_mistakes_end_with_one_sentence(words, says):
    done = run("tango-vbar-closed-loop", *words)
    assert done.returncode == 2
    assert says in " ".join(done.stderr.split())


@pytest.mark.slow
def test_the_real_board_brings_it_to_the_hold_point(tmp_path):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        url = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    log = tmp_path / "log"
    board = subprocess.Popen([*FLYAROUND, "hil", "board", url], stderr=subprocess.DEVNULL)
    try:
        done = run(
            "tango-vbar-closed-loop-tumble",
            "--closed-loop",
            "--truth",
            "off",
            "--listen",
            url,
            "--log",
            str(log),
            "--json",
        )
        assert done.returncode == 0, done.stderr
    finally:
        board.terminate()
        board.wait()
    told = json.loads(done.stdout)["closed_loop"]
    assert (told["pose"], told["outcome"], told["keep_out_violations"]) == ("board", "arrived", 0)
    assert told["final_error_m"] < 0.2
    assert told["final_error_deg"] < 2.0
    ledger = read_ledger(log)
    assert len(ledger) > 200
    # what was drawn is what was flown: the pictures' truth comes nearer as the thrusters had it
    ranges = [sum(x * x for x in row.truth_t_m) ** 0.5 for row in ledger]
    assert ranges[0] > 17.0
    assert ranges[-1] < 3.5


def test_a_forecast_is_a_curve_with_its_foretold_sigma(tmp_path):
    out = tmp_path / "forecast"
    done = completed(
        *FLYAROUND,
        *("hil", "forecast", "tango-vbar-closed-loop-tumble", "-o", str(out)),
        *("--runs", "2", "--horizon", "24", "--json"),
    )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    rigid, constant = told["rigid_body"], told["constant_rate"]
    assert [e["horizon_s"] for e in rigid] == pytest.approx([2.0 * k for k in range(13)])
    rows = list(csv.DictReader((out / "forecast.csv").read_text().splitlines()))
    assert len(rows) == 26
    assert float(rows[12]["rms_deg"]) == pytest.approx(rigid[12]["rms_deg"], rel=1e-5)
    assert (out / "forecast.png").read_bytes().startswith(b"\x89PNG")
    # what the filter foretells of itself holds, and a tumble is no constant rate
    assert all(0.4 < e["rms_deg"] / e["sigma_deg"] < 2.0 for e in rigid)
    assert constant[12]["rms_deg"] > 2 * rigid[12]["rms_deg"]
