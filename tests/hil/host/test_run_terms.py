"""A run's record says what was flown, and no secret."""

import hashlib
import json
from importlib.metadata import version
from importlib.resources import files

import msgspec
import pytest
from hil_loop import Loop, board, frames

from flyaround.__main__ import run
from flyaround.hil.host.board_command import board_command
from flyaround.hil.host.ledger.run_terms import Provenance, read_terms
from flyaround.hil.host.report import write_report
from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.faults import Drop, Faults
from flyaround.simulator.scenario.load import load_scenario, scenario_source
from flyaround.simulator.scenario.plan import plan_flight

NAME = "tango-vbar-closed-loop"
KEY = b"0123456789abcdef-secret"


@pytest.fixture(scope="module")
def plan():
    return plan_flight(load_scenario(NAME), n=1, seed=7)


def test_the_record_of_a_run_says_what_was_flown(plan, tmp_path):
    source = scenario_source(NAME)
    command = ("flyaround", "hil", "host", NAME, "--listen", "tcp://me:password@127.0.0.1:0")
    Loop(board(model_name="tango", model_sha256="ab" * 32, method="oracle")).run(
        frames(2),
        log_dir=tmp_path,
        deadline_s=7.5,
        faults=Faults(line=(Drop(chance=0.0),), seed=3),
        provenance=Provenance.from_plan(plan, source, command),
    )
    told = json.loads((tmp_path / "run.json").read_text())
    assert told["scenario"] == {
        "name": NAME,
        "text": source.decode(),
        "sha256": hashlib.sha256(source).hexdigest(),
    }
    assert (told["seed"], told["target"]) == (7, "tango")
    assert told["target_sha256"] == plan.target.sha256
    assert told["command"][-1] == "tcp://***@127.0.0.1:0"
    assert told["faults"]["line"][0]["kind"] == "drop"
    assert told["versions"]["flyaround"] == version("flyaround")
    assert all(told["versions"][name] for name in ("python", "numpy", "opencv"))
    assert (told["board"]["method"], told["board"]["model_sha256"]) == ("oracle", "ab" * 32)
    assert told["deadline_ms"] == 7500.0
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["board"] == told["board"]
    page = write_report(tmp_path).read_text()
    for said in (NAME, told["scenario"]["sha256"], "drop; seed 3", "ab" * 32, version("flyaround")):
        assert said in page
    assert "password" not in page


def test_no_key_is_recorded(plan, tmp_path):
    Loop(board(key=KEY)).run(frames(2), log_dir=tmp_path, key=KEY, provenance=Provenance.from_plan(plan))
    write_report(tmp_path)
    for path in tmp_path.iterdir():
        assert KEY not in path.read_bytes()
        assert KEY.hex().encode() not in path.read_bytes()


def test_a_scenario_without_a_file_and_one_with_a_password_in_it(plan):
    made = Provenance.from_plan(plan).scenario
    assert json.loads(made.text)["name"] == made.name == NAME
    secret = b"# from https://me:password@example.org/a.toml?token=abc\n"
    kept = Provenance.from_plan(plan, secret).scenario
    assert "password" not in kept.text
    assert "abc" not in kept.text
    assert kept.sha256 == hashlib.sha256(secret).hexdigest()


def test_a_closed_loop_without_a_board_has_its_record(tmp_path):
    log = tmp_path / "log"
    arguments = ["hil", "host", NAME, "--closed-loop", "--pose", "truth", "--seed", "5", "--log", str(log)]
    assert run(arguments) == 0
    terms = read_terms(log)
    assert terms.command == ("flyaround", *arguments)
    assert terms.seed == 5
    assert terms.scenario.text == (files("flyaround.assets.scenarios") / f"{NAME}.toml").read_text()
    assert terms.scenario.sha256 in write_report(log).read_text()


@pytest.mark.parametrize("damage", [b"", b"{", b"[]", b'{"schema": "flyaround.run"}', b"\xff"])
def test_a_damaged_record_is_one_sentence(damage, tmp_path):
    (tmp_path / "run.json").write_bytes(damage)
    with pytest.raises(UserError, match=r"run\.json is not the terms of a run") as caught:
        read_terms(tmp_path)
    assert "\n" not in str(caught.value)


def test_an_older_record_is_read(tmp_path):
    old = {"started_utc": "", "mode": "lockstep", "truth": "off", "url": "", "timeout_s": 1.0}
    (tmp_path / "run.json").write_bytes(msgspec.json.encode(old))
    assert read_terms(tmp_path).scenario is None


@pytest.mark.parametrize(
    ("url", "keyed", "words"),
    [
        ("tcp://127.0.0.1:5600", False, "flyaround hil board tcp://127.0.0.1:5600 --target tango"),
        ("tcp://127.0.0.1:5600", True, "flyaround hil board tcp://127.0.0.1:5600 --target tango --key FILE"),
        ("tcp://192.0.2.7:9", True, "flyaround hil board tcp://192.0.2.7:9 --target tango --key FILE"),
        ("serial:///dev/ttyUSB0?baud=9600", False, "board serial:///dev/ttyUSB0?baud=9600 --target tango"),
    ],
)
def test_what_to_type_on_a_board_is_complete(url, keyed, words):
    assert words in board_command(url, "tango", keyed=keyed)


@pytest.mark.parametrize("url", ["tcp://0.0.0.0:5600", "tcp://[::]:5600"])
def test_no_board_is_told_to_dial_every_address(url):
    words = board_command(url, "tango", keyed=True)
    assert "0.0.0.0" not in words  # noqa: S104 - the address in question
    assert "::" not in words


def test_a_ledger_of_a_run_over_udp_is_read(tmp_path):
    Loop(board()).run(frames(2), log_dir=tmp_path)
    record = tmp_path / "run.json"
    record.write_text(record.read_text().replace("tcp://", "udp://"))
    assert read_terms(tmp_path).url.startswith("udp://")
    assert write_report(tmp_path).exists()


@pytest.mark.parametrize("deadline", ["0", "-1", "nan", "inf"])
def test_a_deadline_is_a_time(deadline, capsys):
    assert run(["hil", "host", NAME, "--deadline", deadline]) == 2
    assert "deadline" in capsys.readouterr().err
