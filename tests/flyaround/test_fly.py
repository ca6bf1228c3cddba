"""fly: the messages and the recording it writes beside the table."""

from typer.testing import CliRunner

from flyaround.cli.app import app
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight


def test_fly_writes_messages_and_a_replay(tmp_path):
    out = tmp_path / "flight"
    options = ["fly", "tango-close-3m", "-o", str(out), "--every", "5", "--oem", "--aem", "--record"]
    assert CliRunner().invoke(app, options).exit_code == 0
    assert {p.name for p in out.iterdir()} == {
        "states.csv",
        "scenario.json",
        "target.oem",
        "chaser.oem",
        "target.aem",
        "chaser.aem",
        "flight.npz",
        "replay.toml",
        "run.toml",
    }
    flown = plan_flight(load_scenario("tango-close-3m"), every_s=5.0)
    again = plan_flight(load_scenario(out / "replay.toml"), every_s=5.0)
    assert [again.scene(k) for k in range(3)] == [flown.scene(k) for k in range(3)]
