"""Ledger files and the report made from them."""

import base64
import csv
import io
import os
import re
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from flyaround.cli.hil_words import summary_text
from flyaround.hil.host.frame_record import FrameRecord, pose_errors
from flyaround.hil.host.ledger.frames_csv import COLUMNS, LedgerWriter, read_ledger
from flyaround.hil.host.ledger.run_terms import RUN_JSON, RunTerms
from flyaround.hil.host.ledger.summary import summarise
from flyaround.hil.host.link_process.ipc import LinkConfig
from flyaround.hil.host.report import write_report
from flyaround.hil.host.report_plots import (
    GREEN,
    MARKERS,
    ORANGE,
    RED,
    WRONG,
    kind_of,
    outcome_colour,
    plot_errors,
)
from flyaround.hil.host.truth_policy import check_access
from flyaround.simulator.errors import UserError

RUN = {
    "started_utc": "2026-01-01T00:00:00+00:00",
    "ended": "completed",
    "mode": "lockstep",
    "truth": "off",
    "url": "tcp://127.0.0.1:5600",
    "timeout_s": 1.0,
}


def row(k, outcome, **more):
    return FrameRecord(
        frame_id=k, epoch_utc="2026-01-01T00:00:00Z", t_s=0.1 * k, exposure_s=0.01, outcome=outcome, **more
    )


def answered(k, outcome, e2e_ms):
    return row(
        k,
        outcome,
        reason='says "no", twice',
        e2e_ms=e2e_ms,
        board_total_ms=e2e_ms - 1,
        uplink_ms=0.5,
        downlink_ms=0.1,
        board_wait_ms=0.05,
        stages_ms={"roi": 0.2 * e2e_ms, "pnp": 0.5 * e2e_ms},
        q_wxyz=(1.0, 0.0, 0.0, 0.0),
        t_m=(0.1, -0.2, 9.0),
        E_T_m=0.01 * (k + 1),
        E_R_deg=0.1 * (k + 1),
    )


ROWS = [answered(k, "declined" if k % 4 == 3 else "accepted", 10.0 + k) for k in range(20)] + [
    row(20, "dropped:timeout", reason="no pose within 1 s"),
    row(21, "dropped:corrupt"),
    row(22, "dropped:timeout"),
]


def known(k, outcome, E_R_deg, E_T_m=0.01):
    """An answered frame whose truth is at 10 m."""
    return replace(answered(k, outcome, 10.0), truth_t_m=(0.0, 0.0, 10.0), E_R_deg=E_R_deg, E_T_m=E_T_m)


def write(folder, rows):
    writer = LedgerWriter(folder)
    for r in rows:
        writer.add(r)
    writer.close()


def test_rows_survive_the_file(tmp_path):
    write(tmp_path, reversed(ROWS))
    back = read_ledger(tmp_path)
    assert [r.frame_id for r in back] == list(range(23))
    assert back[3].reason == 'says "no", twice'
    assert back[3].t_m == (0.1, -0.2, 9.0)
    assert back[20].e2e_ms is None
    assert back[20].q_wxyz is None
    assert all(b.stages_ms.keys() == r.stages_ms.keys() for b, r in zip(back, ROWS, strict=True))


def test_the_header_line_is_documented():
    docs = Path(__file__).parents[3] / "docs"
    assert ",".join(COLUMNS) in (docs / "hil_protocol.md").read_text().splitlines()
    page = (docs / "formats" / "ledger.md").read_text()
    assert all(name in page for name in COLUMNS if not name.startswith("truth_"))


def test_each_row_is_on_disk_at_once_and_half_a_line_is_left_out(tmp_path):
    writer = LedgerWriter(tmp_path)
    writer.add(ROWS[0])
    assert len(read_ledger(tmp_path)) == 1
    writer.close()
    with (tmp_path / "frames.csv").open("a") as file:
        file.write("1,2026-01-01T00:00:00Z,0.1,0.01,acc")
    assert len(read_ledger(tmp_path)) == 1


def test_summary_counts_percentiles_and_misses():
    s = summarise(ROWS, deadline_ms=25.0, **RUN)
    assert (s.sent, s.accepted, s.declined, s.dropped_total) == (23, 15, 5, 3)
    assert s.dropped == {"corrupt": 1, "timeout": 2}
    latencies = [10.0 + k for k in range(20)]
    assert s.e2e_ms_p50 == pytest.approx(np.percentile(latencies, 50))
    assert s.e2e_ms_p99 == pytest.approx(np.percentile(latencies, 99))
    assert s.e2e_ms_max == 29.0
    # four answers come late, three frames have none
    assert s.deadline_misses == 7
    assert s.median_E_T_m == pytest.approx(np.median([0.01 * (k + 1) for k in range(20) if k % 4 != 3]))
    assert [t.name for t in s.stages] == ["roi", "pnp"]


def test_books_that_do_not_add_up_are_an_error():
    with pytest.raises(AssertionError, match="inconsistent ledger"):
        summarise([*ROWS, row(23, "lost somewhere")], **RUN)


def test_pose_errors_of_known_poses():
    half_turn = pose_errors((0, 0, 0, 2.0), (0, 0, 1), (1, 0, 0, 0), (0, 3, 5))
    assert half_turn == pytest.approx((5.0, 180.0))
    assert pose_errors((-1, 0, 0, 0), (0, 0, 1), (1, 0, 0, 0), (0, 0, 1)) == (0.0, 0.0)
    assert pose_errors((0, 0, 0, 0), (0, 0, 1), (1, 0, 0, 0), (0, 0, 1)) == (0.0, 180.0)


@pytest.mark.parametrize("rows", [ROWS, ROWS[:1], ROWS[20:], []], ids=["all", "one", "only drops", "none"])
def test_a_report_of_any_ledger(tmp_path, rows):
    write(tmp_path, rows)
    page = write_report(tmp_path)
    text = page.read_text()
    for source in re.findall(r'src="([^"]+)"', text):
        kind, data = source.split(",")
        assert kind == "data:image/png;base64"
        assert base64.b64decode(data, validate=True).startswith(b"\x89PNG")
    assert f"{len(rows)} sent = " in text
    assert ('alt="latency"' in text) == any(r.e2e_ms is not None for r in rows)
    write_report(tmp_path)  # again, over itself


def test_no_ledger_is_one_sentence(tmp_path):
    with pytest.raises(UserError, match=r"no ledger at .*name a folder"):
        write_report(tmp_path)
    (tmp_path / "frames.csv").write_text("a,b\n1,2\n")
    with pytest.raises(UserError, match="has no column 'frame_id'"):
        write_report(tmp_path)
    write(tmp_path / "ok", ROWS[:2])
    (tmp_path / "ok" / "summary.json").write_text("{}")
    with pytest.raises(UserError, match=r"summary\.json is not a ledger summary"):
        write_report(tmp_path / "ok")


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (b"\xff\xfe,\n", "utf-8"),
        (b"3,2026-01-01T00:00:00Z,0.1,0.01,accepted\n", f"it does not have {len(COLUMNS)} fields"),
        (b"x" * 200_000 + b"\n", "field limit"),
        (b"three" + b"," * (len(COLUMNS) - 1) + b"\n", "outcome '' is invalid"),
        (b"three,,,,declined" + b"," * (len(COLUMNS) - 5) + b"\n", "invalid literal"),
    ],
    ids=["not text", "short", "endless", "no outcome", "no number"],
)
def test_a_damaged_ledger_is_one_sentence(tmp_path, body, said):
    write(tmp_path, ROWS[:2])
    with (tmp_path / "frames.csv").open("ab") as file:
        file.write(body)
    with pytest.raises(
        UserError, match=rf"frames\.csv.* is damaged \(.*{said}.*\): copy the ledger again"
    ) as caught:
        write_report(tmp_path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < len(str(tmp_path)) + 300


VECTORS = [f"{pose}_{axis}" for pose in ("q", "truth_q") for axis in "wxyz"] + ["t_x_m", "truth_t_z_m"]


@pytest.mark.parametrize("column", [n for n in COLUMNS if n.endswith(("_s", "_ms", "confidence"))] + VECTORS)
@pytest.mark.parametrize("value", ["nan", "inf", "1e999", "1" * 400])
def test_a_ledger_has_finite_numbers(tmp_path, column, value):
    complete = replace(
        answered(0, "accepted", 10.0), truth_q_wxyz=(1.0, 0.0, 0.0, 0.0), truth_t_m=(0.0, 0.0, 9.0)
    )
    write(tmp_path, [complete])
    path = tmp_path / "frames.csv"
    (cells,) = csv.DictReader(io.StringIO(path.read_text()))
    names = {"nan": "NaN", "inf": "Infinity"}
    cells[column] = f'{{"sum": {names.get(value, value)}}}' if column == "stages_ms" else value
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerow(cells)
    with pytest.raises(UserError, match=r"frames\.csv, line 2, is damaged"):
        read_ledger(tmp_path)


def test_a_line_cut_off_within_a_letter_is_left_out(tmp_path):
    write(tmp_path, ROWS[:2])
    with (tmp_path / "frames.csv").open("ab") as file:
        file.write(b"2,2026-01-01T00:00:00Z,0.1,0.01,declined,\xc3")
    assert len(read_ledger(tmp_path)) == 2


@pytest.mark.parametrize("name", ["frames.csv", "run.json", "summary.json"])
def test_a_report_waits_for_no_pipe_and_reads_no_text_that_is_none(tmp_path, name):
    write(tmp_path, ROWS[:2])
    path = tmp_path / name
    path.unlink(missing_ok=True)
    os.mkfifo(path)
    with pytest.raises(UserError, match=f"{name} is a pipe or a device"):
        write_report(tmp_path)
    path.unlink()
    path.write_bytes(b'{"schema": "\xff"}\n')
    with pytest.raises(UserError, match=name):
        write_report(tmp_path)


def test_a_pose_far_off_is_wrong_though_accepted(tmp_path):
    rows = [known(k, "accepted", 129.0) for k in range(4)]
    rows += [known(4, "accepted", 0.2), known(5, "accepted", 0.2, E_T_m=0.51), known(6, "declined", 90.0)]
    rows += [answered(7, "accepted", 12.0), known(8, "accepted", float("nan"))]
    s = summarise(rows, **RUN)
    # not those whose truth is not known, nor declined ones
    assert (s.accepted, s.accepted_known, s.accepted_wrong) == (8, 7, 6)
    assert [kind_of(row) for row in rows] == [
        *[WRONG] * 4,
        "accepted",
        WRONG,
        "declined",
        "accepted",
        WRONG,
    ]
    assert [outcome_colour(kind) for kind in MARKERS] == [GREEN, RED, ORANGE]
    left, _ = plot_errors(rows, None).axes
    drawn = {line.get_label(): line.get_color() for line in left.get_lines()}
    assert drawn[f"{WRONG} (6)"] == RED
    write(tmp_path, rows)
    page = write_report(tmp_path).read_text()
    assert '<div class="tile bad"><b>6 of 7</b><span>accepted poses wrong</span>' in page
    said = summary_text(s, None)
    assert [said.plain[span.start : span.end] for span in said.spans if span.style == "red"] == [
        "6 of 7 accepted poses are wrong"
    ]
    right = summary_text(summarise(rows[4:5], **RUN), tmp_path)
    assert "0 of 1 accepted poses are wrong" in right.plain
    assert not any(span.style == "red" for span in right.spans)
    assert f"flyaround hil report {tmp_path}" in right.plain


@pytest.mark.parametrize("truth", ["off", "separate", "inline"])
def test_the_report_of_a_killed_run_says_what_it_was_told(tmp_path, truth):
    write(tmp_path, ROWS)
    assert "truth not recorded" in write_report(tmp_path).read_text()
    terms = RunTerms(
        started_utc="2026-01-01T00:00:00+00:00",
        mode="realtime",
        truth=truth,
        url="tcp://127.0.0.1:5600",
        timeout_s=2.0,
    )
    (tmp_path / RUN_JSON).write_bytes(msgspec.json.encode(terms))
    page = " ".join(write_report(tmp_path).read_text().split())
    terms_shown = ("realtime", "tcp://127.0.0.1:5600", f"truth {truth}", "the host was killed")
    assert " \N{MIDDLE DOT} ".join(terms_shown) in page
    # neither zeros for what nobody counted, nor this machine for the run's, nor a link to nothing
    assert "Board: not recorded. Host: not recorded." in page
    assert "Link: not recorded." in page
    assert "summary.json" not in page
    (tmp_path / RUN_JSON).write_text("{}")
    with pytest.raises(UserError, match=r"run\.json is not the terms of a run of this version"):
        write_report(tmp_path)


@pytest.mark.parametrize(
    ("url", "truth_url", "open_to_all"),
    [
        ("tcp://127.0.0.1:5600", None, False),
        ("tcp://localhost:5600", None, False),
        ("tcp://[::1]:5600", None, False),
        ("serial:///dev/ttyUSB0?baud=921600", None, False),
        ("tcp://0.0.0.0:5600", None, True),
        ("tcp://[::]:5600", None, True),
        ("tcp://192.0.2.7:5600", None, True),
        ("tcp://127.0.0.1:5600", "tcp://192.0.2.7:5601", True),
    ],
)
def test_addresses_of_other_machines_need_a_key(url, truth_url, open_to_all):
    link = LinkConfig(url=url, mode="lockstep", truth="separate", timeout_s=1.0, truth_url=truth_url)
    check_access(replace(link, key=b"0123456789abcdef"))
    if open_to_all:
        with pytest.raises(UserError, match="give both sides a key"):
            check_access(link)
    else:
        check_access(link)


@pytest.mark.parametrize(
    ("late", "told"),
    [
        ((True, False, None, None, False), 1),
        ((False, False, None), 0),
        ((True, True), 2),
        ((None, None), None),
    ],
)
def test_lateness_is_counted_of_the_frames_where_it_is_known(late, told):
    """A frame in time is known as well; of a run that knows of none, no count is told."""
    rows = [row(k, "dropped:timeout", late=one) for k, one in enumerate(late)]
    assert summarise(rows, **RUN).late == told
