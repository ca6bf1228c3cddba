"""Campaigns: flown unattended, broken off and gone on with, judged, and read by others' readers of JUnit XML."""

import hashlib
import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import junitparser
import pytest
from lxml import etree

from flyaround.__main__ import run
from flyaround.hil.campaign.case_run import RunResult
from flyaround.hil.campaign.definitions import read_campaign
from flyaround.hil.campaign.junit import junit_xml
from flyaround.hil.campaign.quantities import QUANTITIES
from flyaround.hil.campaign.verdicts import RunVerdict, Verdict, judge, worst_verdict
from flyaround.simulator.errors import UserError

EXAMPLE = Path(__file__).parents[3] / "examples" / "campaign.toml"
SCHEMA = Path(__file__).parents[2] / "harness" / "junit.xsd"

SMALL = """
name = "small"
[[case]]
name = "steady"
scenario = "tango-vbar-closed-loop"
closed_loop = true
pose = "noisy"
seeds = [1, 2, 3]
[[requirement]]
name = "at the hold point"
quantity = "final_error_m"
comparison = "<="
limit = 0.2
"""


def contents(folder):
    """SHA-256 of every file, by its place."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def killed_after(command, is_enough):
    """Begin a command, and kill it, with nothing left of a chance to tidy up."""
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    until = time.monotonic() + 120
    while process.poll() is None and time.monotonic() < until and not is_enough():  # type: ignore[operator]
        time.sleep(0.02)
    process.kill()  # a run may have ended before
    process.wait()


def command(file, out, *words):
    return [sys.executable, "-m", "flyaround", "hil", "campaign", str(file), "-o", str(out), *words]


@pytest.mark.gl
def test_the_example_is_flown_although_it_is_killed_and_everybody_can_read_it(tmp_path):
    out = tmp_path / "out"
    killed_after(command(EXAMPLE, out), (out / "runs" / "steady" / "seed-1").is_dir)
    assert not (out / "campaign.json").exists()
    assert run(["hil", "campaign", str(EXAMPLE), "-o", str(out), "--workers", "2"]) == 0
    told = json.loads((out / "campaign.json").read_text())
    assert [set(case) for case in told["cases"]] == [{"name", "seed", "passed", "reason"}] * 5
    assert [(case["name"], case["seed"]) for case in told["cases"]][:3] == [
        ("steady", 1),
        ("steady", 2),
        ("tumbling-late", 1),
    ]
    assert all(case["passed"] is True and case["reason"] == "" for case in told["cases"])
    # every link of the matrix leads to a file
    page = (out / "index.html").read_text()
    links = set(re.findall(r'href="([^"]+)"', page))
    assert len(links) == 5
    assert all((out / link).is_file() for link in links)
    etree.XMLSchema(file=str(SCHEMA)).assertValid(etree.parse(str(out / "junit.xml")))
    suites = junitparser.JUnitXml.fromfile(str(out / "junit.xml"))
    assert [suite.name for suite in suites] == ["steady", "tumbling-late", "outage", "board"]
    assert [(suite.tests, suite.failures) for suite in suites] == [(8, 0), (4, 0), (4, 0), (2, 0)]
    # the board's ledger tells no time of the wall
    rows = (out / "runs" / "board" / "seed-1" / "frames.csv").read_text().splitlines()
    assert len(rows) == 3
    assert "accepted" in rows[1]
    assert not list(out.rglob("*.part"))


def test_the_same_file_gives_the_same_bytes_and_a_requirement_that_is_not_met_exits_1(tmp_path, capsys):
    file = tmp_path / "small.toml"
    file.write_text(SMALL.replace("[1, 2, 3]", "[1]").replace("limit = 0.2", "limit = 1e-6"))
    outs = [tmp_path / "a", tmp_path / "b"]
    for out in outs:
        assert run(["hil", "campaign", str(file), "-o", str(out)]) == 1
    assert contents(outs[0]) == contents(outs[1])
    assert len(contents(outs[0])) == 10
    case = json.loads((outs[0] / "campaign.json").read_text())["cases"][0]
    assert not case["passed"]
    assert case["reason"].startswith("at the hold point: final_error_m is 0.00")
    suites = junitparser.JUnitXml.fromfile(str(outs[0] / "junit.xml"))
    assert next(iter(suites)).failures == 1
    capsys.readouterr()
    # other requirements of the same runs: nothing is flown anew
    file.write_text(SMALL.replace("[1, 2, 3]", "[1]"))
    before = (outs[0] / "runs" / "steady" / "seed-1" / "result.json").stat()
    assert run(["hil", "campaign", str(file), "-o", str(outs[0])]) == 0
    assert (outs[0] / "runs" / "steady" / "seed-1" / "result.json").stat() == before
    # other settings: not taken for these
    file.write_text(SMALL.replace("[1, 2, 3]", "[1]").replace('"noisy"', '"truth"'))
    assert run(["hil", "campaign", str(file), "-o", str(outs[0])]) == 2
    assert "was flown with other settings" in " ".join(capsys.readouterr().err.split())
    file.write_text(SMALL.replace("[1, 2, 3]", "[7]"))
    assert run(["hil", "campaign", str(file), "-o", str(outs[0])]) == 2
    assert "that is not in the campaign file" in " ".join(capsys.readouterr().err.split())
    (tmp_path / "c").mkdir()
    (tmp_path / "c" / "mine.txt").write_text("keep")
    assert run(["hil", "campaign", str(file), "-o", str(tmp_path / "c")]) == 2
    assert sorted(p.name for p in (tmp_path / "c").iterdir()) == ["mine.txt"]


@pytest.mark.slow
def test_killed_at_any_place_it_comes_to_the_same(tmp_path):
    file = tmp_path / "small.toml"
    file.write_text(SMALL)
    assert run(["hil", "campaign", str(file), "-o", str(tmp_path / "whole")]) == 0
    out = tmp_path / "killed"
    for wait_s in (0.1, 2.0, 3.0, 3.5, 4.0, 4.5, 5.0):
        start = time.monotonic()
        killed_after(
            command(file, out, "--workers", "2"),
            lambda: time.monotonic() > start + wait_s,  # noqa: B023
        )
    assert run(["hil", "campaign", str(file), "-o", str(out), "--workers", "2"]) == 0
    assert contents(out) == contents(tmp_path / "whole")


@pytest.mark.slow
@pytest.mark.gl
def test_drawn_runs_with_a_board_give_the_same_bytes_again(tmp_path):
    for name in ("a", "b"):
        assert run(["hil", "campaign", str(EXAMPLE), "-o", str(tmp_path / name), "--workers", "2"]) == 0
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("limit = 0.2", 'limit = "arrived"'), "limit is 'arrived', but final_error_m is a number"),
        (("limit = 0.2", "limit = nan"), "requirement[0].limit is nan"),
        (("final_error_m", "final_eror_m"), "did you mean final_error_m?"),
        (("final_error_m", "e2e_ms_p99"), 'has no e2e_ms_p99, which needs mode = "realtime" and a board'),
        (("final_error_m", "accepted_wrong"), "has no accepted_wrong, which needs frames"),
        (('"<="', '"<<"'), "allowed: !=, <, <=, ==, >, >="),
        (('pose = "noisy"', 'pose = "nosy"'), "did you mean 'noisy'?"),
        (("closed_loop = true\n", ""), "needs closed_loop = true"),
        (("seeds = [1, 2, 3]", "seeds = [1, 1]"), "has a seed twice"),
        (("seeds = [1, 2, 3]", "seeds = { first = 1, count = 100000 }"), "at most 20000"),
        (("seeds = [1, 2, 3]", "seeds = [-1]"), "at least 0"),
        (("seeds = [1, 2, 3]", 'mode = "realtime"'), "leave out mode and link"),
        (("seeds = [1, 2, 3]", "frames = 3"), "every_s instead of frames"),
        (("seeds = [1, 2, 3]", 'method = "guess"'), "unknown method 'guess'"),
        (("seeds = [1, 2, 3]", 'faults = "nothing.toml"'), "nothing.toml cannot be read"),
        (
            ("seeds = [1, 2, 3]", '[[case.faults.camera]]\nkind = "frozen"'),
            "a fault 'frozen' needs a board",
        ),
        (
            ("seeds = [1, 2, 3]", '[[case.faults.line]]\nkind = "delay"\ndelay_ms = 1.0\nend_s = 0.0'),
            "ends at 0 s and starts at 0 s",
        ),
        (('scenario = "tango-vbar', 'scenario = "tangoo-vbar'), "tangoo-vbar-closed-loop"),
        (('name = "steady"', 'name = "../steady"'), "case[0].name"),
        (('name = "steady"', 'name = "steady"\nspeed = 3'), "unknown key speed in section [case[0]]"),
        (("limit = 0.2", 'limit = 0.2\ncases = ["fast*"]'), "applies to no case: fast* matches none"),
        (("[[case]]", "[[case"), "is not valid TOML"),
        (('name = "small"', "a" + ".a" * 40 + " = 1"), "key of more than 16 dots"),
    ],
)
def test_a_mistake_in_the_file_is_one_sentence(tmp_path, change, says):
    file = tmp_path / "bad.toml"
    assert change[0] in SMALL
    file.write_text(SMALL.replace(*change, 1))
    with pytest.raises(UserError) as error:
        read_campaign(file)
    assert says in str(error.value)
    assert "\n" not in str(error.value)


def test_what_is_no_file_of_ours(tmp_path, capsys):
    pipe = tmp_path / "pipe.toml"
    os.mkfifo(pipe)
    big = tmp_path / "big.toml"
    big.write_bytes(b"#" * 1_000_001)
    for path, says in (
        (pipe, "is a pipe or a device"),
        (big, "make it smaller"),
        (tmp_path / "no.toml", "cannot be read"),
    ):
        assert run(["hil", "campaign", str(path), "-o", str(tmp_path / "out")]) == 2
        assert says in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "out").exists()


def requirement(tmp_path, quantity="final_error_m", comparison="<=", limit="0.2"):
    file = tmp_path / "one.toml"
    text = SMALL.replace("final_error_m", quantity).replace('"<="', f'"{comparison}"')
    file.write_text(text.replace("limit = 0.2", f"limit = {limit}"))
    return read_campaign(file)


@pytest.mark.parametrize(
    ("comparison", "value", "passed", "margin"),
    [
        ("<=", 0.2, True, 0.0),
        ("<", 0.2, False, 0.0),
        ("<=", 0.05, True, 0.15),
        (">=", 0.05, False, -0.15),
        (">", 0.5, True, 0.3),
        ("==", 0.5, False, -0.3),
        ("!=", 0.5, True, 0.3),
        ("<=", None, False, None),
    ],
)
def test_margins(tmp_path, comparison, value, passed, margin):
    campaign, _ = requirement(tmp_path, comparison=comparison)
    verdict = Verdict.from_value(campaign.requirement[0], value)
    assert verdict.passed is passed
    assert verdict.margin == (None if margin is None else pytest.approx(margin))


def test_the_worst_run_has_no_value_or_failed_or_came_nearest(tmp_path):
    one = requirement(tmp_path)[0].requirement[0]
    far, near, out, none = (Verdict.from_value(one, value) for value in (0.01, 0.19, 0.3, None))
    assert worst_verdict([far, near]) is near
    assert worst_verdict([far, out, near]) is out
    assert worst_verdict([out, none, far]) is none


def test_a_run_that_the_board_left_has_failed_unless_that_is_required(tmp_path):
    campaign, _ = requirement(tmp_path)
    left = RunResult(inputs="", values={"final_error_m": 0.0, "ended": "board_lost"})
    assert judge(campaign, "steady", 1, left).reason == "the run ended: board lost"
    asked, _ = requirement(tmp_path, "ended", "==", '"board_lost"')
    assert judge(asked, "steady", 1, left).passed


def test_junit_of_hostile_words_is_valid(tmp_path):
    file = tmp_path / "odd.toml"
    file.write_text(SMALL.replace("at the hold point", "<a href='x'>&amp; \\u0007 \\u20ac"))
    campaign, cases = read_campaign(file)
    verdict = Verdict.from_value(campaign.requirement[0], None)
    runs = [
        RunVerdict("steady", 1, "it broke: ]]> \x00\x1b[31m", (verdict,)),
        RunVerdict("steady", 2, "", (verdict,)),
    ]
    path = tmp_path / "junit.xml"
    path.write_bytes(junit_xml(campaign, cases, runs, {}))
    etree.XMLSchema(file=str(SCHEMA)).assertValid(etree.parse(str(path)))
    suite = next(iter(junitparser.JUnitXml.fromfile(str(path))))
    assert (suite.tests, suite.failures) == (2, 2)


def test_the_document_explains_every_quantity():
    page = (Path(__file__).parents[3] / "docs" / "hil_campaign.md").read_text()
    assert [name for name in QUANTITIES if f"`{name}`" not in page] == []
