"""Runs as documents: their examples, what is refused of a file, and what a command writes of its own."""

import tomllib
from pathlib import Path
from typing import Any

import msgspec
import pytest

from flyaround.__main__ import run
from flyaround.cli import run_options
from flyaround.runs.capture import CaptureRun
from flyaround.runs.document import run_toml
from flyaround.runs.schema import RUNS
from flyaround.simulator.errors import UserError

EXAMPLES = Path(__file__).parents[2] / "examples" / "runs"
CAPTURE = 'scenario = "tango-space-10m"\n[pictures]\nn = 1\nquality = "draft"\n'

WORDS = {
    "sim": "tango-flyaround --size 1600x1000 --overlays keypoints,times --seconds 60",
    "render": "tango-flyaround -t 12.5 --quality high --labels depth,normals",
    "fly": "tango-flyaround --every 0.5 --oem --aem --record",
    "film": "tango-flyaround --width 1280 --fps 30 --speed 20 --from 60 --to 360 --rgb",
    "capture": "tango-flyaround -n 200 --quality high --seed 7 --format coco,speed --labels depth,parts"
    " --split 8:1:1 --workers 4",
    "convert": "out/set --format coco --split 8:1:1",
    "estimate": "out/set/images/000000.png out/set/images/000001.png --target tango --camera speed"
    " --method svd-thesis --solver mle --streams wge,sh",
    "evaluate": "out/set --method hybrid --method svd-thesis --workers 2",
    "train": "out/set --steps 4000 --network small --width 128 --seed 3",
    "compare": "--reference pictures-of-others -n 8 --target tango --camera speed",
    "bench": "-n 5 --scene tango-space-10m --scene tango-earth-10m",
    "hil host": "tango-flyaround --listen tcp://127.0.0.1:5600 --truth off --max-misses 0 --every 2 --time-code"
    " --mode realtime --latency 0.05 --deadline 1.5",
    "hil board": "tcp://127.0.0.1:5600 --target tango --method hybrid --watchdog 5 --reconnect",
    "hil camera": "tango-limb --interface lo --allow 127.0.0.1 --allow 127.0.0.2 --loop 60 --rate 20",
    "hil campaign": "examples/campaign.toml --workers 2",
    "hil delay-map": "tango-vbar-closed-loop --latency 0.3,2,4 --jitter 0,1 --drops 0,0.3 --flights 10",
    "targets add": "my-satellite.obj --name my-satellite --units mm --up z --recentre --decimate 20000 --fill-holes"
    " --mass 410",
}
"""The words that ask for the run of each example."""
PLACED = {"fly", "film", "capture", "convert", "train", "hil campaign", "hil delay-map"}
"""Commands that need to be told where their result goes."""


def words_of(command, *words):
    place = ["-o", "out/x.npz"] if command in PLACED else []
    return [*command.split(), *words, *place]


class Asked(Exception):  # noqa: N818 - no error
    """Raised in place of a command's work."""


@pytest.fixture
def asked(monkeypatch):
    """Run a command up to its work; return its run."""
    made: list[Any] = []
    check = run_options.refuse_exclusions

    def checked(document):
        check(document)
        made.append(document)
        raise Asked

    monkeypatch.setattr(run_options, "refuse_exclusions", checked)

    def ask(*words):
        with pytest.raises(Asked):
            run(list(words))
        return made.pop()

    return ask


def test_each_command_with_runs_has_an_example():
    assert {path.stem for path in EXAMPLES.glob("*.toml")} == {
        c.replace(" ", "_").replace("-", "_") for c in RUNS
    }
    assert set(WORDS) == set(RUNS)


@pytest.mark.parametrize("command", RUNS)
def test_an_example_is_the_run_of_its_words(command, asked):
    file = EXAMPLES / f"{command.replace(' ', '_').replace('-', '_')}.toml"
    by_words = asked(*words_of(command, *WORDS[command].split()))
    assert asked(*words_of(command, "--run", str(file))) == by_words
    schema = tomllib.loads(file.read_text())["schema"]
    assert msgspec.to_builtins(by_words)["schema"] == schema


@pytest.mark.parametrize("command", RUNS)
def test_what_is_written_of_a_run_asks_for_it_again(command, asked, tmp_path):
    by_words = asked(*words_of(command, *WORDS[command].split()))
    file = tmp_path / "run.toml"
    file.write_bytes(run_toml(by_words))
    again = asked(*words_of(command, "--run", str(file)))
    assert run_toml(again) == run_toml(by_words)


def test_options_override_the_file(asked, tmp_path):
    file = tmp_path / "run.toml"
    file.write_text('output = "there"\n' + CAPTURE)
    made = asked("capture", "--run", str(file), "-n", "5", "tango-limb")
    assert (made.scenario, made.output, made.pictures.n, made.pictures.quality) == (
        "tango-limb",
        "there",
        5,
        "draft",
    )


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ('schema = "flyaround.run.hil-host"\n', "this command's runs have 'flyaround.run.capture'"),
        ('schema = "flyaround.scenario"\n', "has the schema 'flyaround.scenario'"),
        ("version = 2\n", "key version is 2, allowed: 1"),
        ("scenary = 1\n", "unknown key scenary at the top level: did you mean scenario?"),
        ("[pictures]\nevery_min = 2\n", "unknown key every_min in section [pictures]: did you mean every_s?"),
        ("[pictures]\nn = 0\n", "key pictures.n is 0, allowed: a whole number of at least 1"),
        ('[pictures]\nn = "many"\n', "key pictures.n is 'many', allowed: a whole number"),
        ('[pictures]\nquality = "hihg"\n', "(did you mean 'high'?)"),
        (
            "[drawing]\nworkers = 65\n",
            "key drawing.workers is 65, allowed: a whole number of at least 1 and at most 64",
        ),
        ("[pictures]\nn = 2\nevery_s = 1.0\n", "takes -n or --every, not both"),
        ("[pictures]\nevery_s = nan\n", "nan"),
        ("pictures = 3\n", "key pictures is 3, allowed: a table"),
        ("scenario = \n", "is not valid TOML"),
        ("a = " + "[" * 100 + "]" * 100, "nests more than 64 brackets"),
        ("#" * 1_000_001, "at most 1,000,000 bytes are read"),
    ],
)
def test_a_mistake_in_the_file_is_one_sentence(text, sentence, tmp_path, capsys):
    file = tmp_path / "mine.toml"
    file.write_text(text)
    assert run(["capture", "--run", str(file), "-o", str(tmp_path / "set"), "tango-limb"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert sentence in said
    assert not (tmp_path / "set").exists()


def test_a_file_that_is_not_there_is_one_sentence(tmp_path, capsys):
    assert run(["capture", "--run", str(tmp_path / "none.toml")]) == 2
    assert "none.toml cannot be read" in " ".join(capsys.readouterr().err.split())
    assert run(["capture", "--run", str(tmp_path)]) == 2
    assert len(capsys.readouterr().err.splitlines()) <= 2


def test_what_neither_file_nor_words_say_is_asked_for(tmp_path, capsys):
    file = tmp_path / "run.toml"
    file.write_text("[pictures]\nn = 1\n")
    assert run(["capture", "--run", str(file), "-o", str(tmp_path / "set")]) == 2
    assert "Missing argument" in capsys.readouterr().err


def test_a_record_has_no_secrets_and_not_where_the_result_goes():
    made = CaptureRun(
        scenario="s3://key:word@bucket/one.toml", output="s3://key:word@bucket/set", resume=True
    )
    text = run_toml(made).decode()
    assert "word" not in text
    assert "resume" not in text
    assert tomllib.loads(text)["data_set"] == {"formats": "native", "sensors": ""}


def test_any_name_can_be_recorded():
    for name in ("é", "\U0001f6f0", 'a"b\\c\n', "\x7f", "tail\udcff"):
        again = tomllib.loads(run_toml(CaptureRun(scenario=name, output="out")).decode())["scenario"]
        assert again == name.replace("\udcff", "?")


def test_an_option_with_a_value_that_is_none_of_a_choice_is_named(asked):
    with pytest.raises(
        UserError, match=r"--quality is 'hihg', allowed: default, draft, high \(did you mean 'high'"
    ):
        run_options.make_run(CaptureRun, {"scenario": "a", "output": "b", "quality": "hihg"})
    assert asked("capture", "a", "-o", "b", "--quality", "HIGH").pictures.quality == "high"


@pytest.mark.gl
def test_a_capture_from_a_file_is_that_of_the_words_in_every_byte(tmp_path):
    file = tmp_path / "run.toml"
    file.write_text(CAPTURE)
    a, b = tmp_path / "a", tmp_path / "b"
    assert run(["capture", "--run", str(file), "-o", str(a)]) == 0
    assert (
        run(["capture", "tango-space-10m", "-n", "1", "--quality", "draft", "-o", str(b), "--workers", "2"])
        == 0
    )
    made = [{p.relative_to(d): p.read_bytes() for p in d.rglob("*") if p.is_file()} for d in (a, b)]
    assert Path("run.toml") in made[0]
    assert made[0] == made[1]
    assert run(["capture", "--run", str(a / "run.toml"), "-o", str(a), "--resume"]) == 0
