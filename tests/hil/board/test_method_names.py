"""Names of the methods: the former ones are refused where they are typed and read where a file holds them."""

import json
import logging
from pathlib import Path

import pytest

from flyaround.__main__ import run
from flyaround.gui.app import command_table
from flyaround.gui.script import Script
from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.method_names import METHODS
from flyaround.hil.board.methods import check_method_name
from flyaround.hil.campaign.definitions import read_campaign
from flyaround.hil.evaluate.result_rows import existing_rows
from flyaround.runs.document import read_run
from flyaround.runs.estimation import EstimateRun, EvaluateRun

V01 = Path(__file__).parents[2] / "data" / "v0.1"


def test_every_method_has_a_name_and_the_former_ones_are_refused_with_the_present_ones():
    for method in METHODS:
        check_method_name(method)
    for former, now in (("svd", "hybrid"), ("svd-track", "hybrid-track")):
        with pytest.raises(BoardModelError) as refused:
            check_method_name(former)
        for name in (former, now, "svd-2018", "svd-thesis"):
            assert repr(name) in str(refused.value)


def test_a_command_refuses_the_former_name_in_one_sentence(tmp_path, capsys):
    for command in (
        ("estimate", str(tmp_path / "a.png"), "--method", "svd"),
        ("evaluate", str(tmp_path), "--method", "svd-track"),
        ("hil", "board", "tcp://127.0.0.1:9", "--target", "tango", "--method", "svd"),
    ):
        assert run(command) == 2
        told = capsys.readouterr().err
        assert "hybrid" in told
        assert "svd-2018" in told
        assert len(told.splitlines()) == 1


def warnings_of(caplog, path):
    return [m for m in caplog.messages if m.startswith(str(path))]


def test_a_campaign_file_with_the_former_name_is_read_and_says_so_once(tmp_path, caplog):
    path = tmp_path / "campaign.toml"
    case = '[[case]]\nname = "{}"\nscenario = "tango-flyaround"\nmethod = "svd"\nframes = 2\n'
    limit = '[[requirement]]\nname = "r"\nquantity = "dropped"\ncomparison = "<="\nlimit = 0\n'
    path.write_text(f'name = "names"\n{case.format("a")}{case.format("b")}{limit}')
    with caplog.at_level(logging.WARNING):
        campaign, _ = read_campaign(path)
    assert [c.method for c in campaign.case] == ["hybrid", "hybrid"]
    assert len(warnings_of(caplog, path)) == 1


def test_a_run_file_with_the_former_name_is_read(tmp_path):
    path = tmp_path / "run.toml"
    path.write_text('methods = ["svd", "svd-thesis"]\n')
    assert read_run(path, EvaluateRun)["methods"] == ["hybrid", "svd-thesis"]
    path.write_text('method = "svd-track"\n')
    assert read_run(path, EstimateRun)["method"] == "hybrid-track"


def test_rows_of_an_evaluation_with_the_former_name_are_rows_of_the_present_one(tmp_path, caplog):
    path = tmp_path / "rows.jsonl"
    path.write_bytes((V01 / "report" / "rows.jsonl").read_bytes())
    with caplog.at_level(logging.WARNING):
        rows = existing_rows(path)
    assert rows
    assert {r.method for r in rows} == {"hybrid"}
    assert len(warnings_of(caplog, path)) == 1


def test_the_report_of_a_recorded_run_names_the_present_method(tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    for path in (V01 / "run").iterdir():
        if path.is_file():
            (folder / path.name).write_bytes(path.read_bytes())
    summary = json.loads((folder / "summary.json").read_text())
    summary["board"]["method"] = "svd"
    (folder / "summary.json").write_text(json.dumps(summary))
    assert run(["hil", "report", str(folder)]) == 0
    assert "method hybrid" in (folder / "report.html").read_text(encoding="utf-8")


def test_a_script_of_the_console_with_the_former_name_is_read():
    script = Script.parse(
        "1 estimator.method svd-track\n2 hil.board svd\n3 hil.board svd-2018\n", command_table()
    )
    assert [line.arguments for line in script.lines] == [("hybrid-track",), ("hybrid",), ("svd-2018",)]
