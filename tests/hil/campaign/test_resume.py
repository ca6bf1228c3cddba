"""A campaign that goes on takes no run of another version, model or board for its own."""

import json

import msgspec
import pytest

from flyaround.hil.campaign import campaign as campaigns
from flyaround.hil.campaign.campaign import run_campaign
from flyaround.hil.campaign.case_run import RunResult, current_versions, inputs_of, read_result
from flyaround.hil.host.link_process.ipc import Board

TOML = """
name = "resumed"
[[case]]
name = "met"
scenario = "tango-space-10m"
frames = 2
mode = "realtime"
deadline_s = 2.0
seeds = [1, 2, 3]
link = { listen = "tcp://127.0.0.1:5600" }
[[requirement]]
name = "on time"
quantity = "deadline_misses"
comparison = "=="
limit = 0
"""


class Bench:
    """A campaign whose runs are not flown: each leaves the result of the board that is connected."""

    def __init__(self, folder):
        self.folder, self.flown, self.said = folder, [], []
        self.board = Board(
            name="a", model="tango", model_sha256="00", method="hybrid", encoding="raw", window=1
        )

    def fly(self, task):
        self.flown.append(task.seed)
        result = RunResult(
            inputs=inputs_of(task.ready),
            flown_by=current_versions(task.ready),
            board=self.board,
            gl_renderer="llvmpipe",
            values={"ended": "completed", "deadline_misses": 0.0},
        )
        task.folder.mkdir(parents=True)
        (task.folder / "result.json").write_bytes(msgspec.json.encode(result))

    def go_on(self, **options):
        """Fly what is to be flown; seeds, and the campaign's outcome."""
        self.flown, self.said = [], []
        file = self.folder / "one.toml"
        file.write_text(TOML)
        outcome = run_campaign(file, self.folder / "out", board_command=(), say=self.said.append, **options)
        return self.flown, outcome

    def change(self, seed, **values):
        path = self.folder / "out" / "runs" / "met" / f"seed-{seed}" / "result.json"
        result = read_result(path.parent)
        path.write_bytes(msgspec.json.encode(msgspec.structs.replace(result, **values)))


@pytest.fixture
def bench(tmp_path, monkeypatch):
    made = Bench(tmp_path)
    # in this process, one after the other
    monkeypatch.setattr(campaigns, "run_tasks", lambda _work, tasks, _workers: (made.fly(t) for t in tasks))
    return made


def test_what_is_flown_is_kept_and_recorded(bench):
    flown, outcome = bench.go_on(command=("flyaround", "hil", "campaign", "one.toml"))
    assert flown == [1, 2, 3]
    assert bench.go_on()[0] == []
    assert bench.said == []
    told = json.loads((bench.folder / "out" / "campaign.json").read_text())
    assert told["scenarios"][0]["name"] == "tango-space-10m"
    assert "schema" in told["scenarios"][0]["text"]
    (case,) = told["flown"]
    assert case["scenario_sha256"] == told["scenarios"][0]["sha256"]
    assert (case["seeds"], case["gl_renderers"]) == ([1, 2, 3], ["llvmpipe"])
    assert [board["name"] for board in case["boards"]] == ["a"]
    assert len(case["model_sha256"]) == 64
    assert outcome.command == ("flyaround", "hil", "campaign", "one.toml")
    assert told["versions"]["opencv"]


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"flyaround": "0.0.1"}, "another version"),
        ({"flyaround": "", "model_sha256": ""}, "another version"),  # older than the record
        ({"model_sha256": "ab"}, "another model of the target"),
        ({"board": "another OpenCV"}, "another board"),
    ],
)
def test_a_run_of_other_versions_is_flown_again_and_said(bench, change, why):
    bench.go_on()
    old = read_result(bench.folder / "out" / "runs" / "met" / "seed-2").flown_by
    bench.change(2, flown_by=msgspec.structs.replace(old, **change))
    flown, outcome = bench.go_on()
    assert flown == [2]
    assert bench.said == [f"1 run of case 'met' had {why} and is repeated"]
    assert outcome.passed


def test_runs_of_another_board_than_the_one_that_is_met_now_are_flown_again(bench):
    bench.go_on()
    bench.board = msgspec.structs.replace(bench.board, name="b")
    # nothing to fly: nobody was met, and the record says which board it was
    assert bench.go_on()[0] == []
    bench.change(3, flown_by=msgspec.structs.replace(flown_by_of(bench), flyaround="0.0.1"))
    flown, outcome = bench.go_on()
    assert flown == [3, 1, 2]
    assert bench.said[-1] == "2 runs of case 'met' had another board and are repeated"
    assert [board.name for board in outcome.flown[0].boards] == ["b"]


def flown_by_of(bench):
    return read_result(bench.folder / "out" / "runs" / "met" / "seed-3").flown_by
