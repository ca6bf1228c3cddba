"""Every TOML file is read by one guarded reader: bounded, BOM or not, one sentence for what it refuses."""

import time
from pathlib import Path

import pytest

from flyaround.hil.campaign.definitions import read_campaign
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.toml_file import MAX_TOML_BYTES, parse_toml
from flyaround.simulator.scenario.faults import read_faults
from flyaround.simulator.scenario.load import load_recipe, load_scenario, load_vary

READERS = [load_scenario, load_recipe, load_vary, read_faults, read_campaign]
HOSTILE = [
    b"a." * 40_000 + b"a = 1",
    b"[" + b"a." * 40_000 + b"a]",
    b"[[" + b"'a'. " * 20_000 + b"a]]",
    b"x = {" + b"a." * 40_000 + b"a = 1}",
    b"a = " + b"[" * 5_000,
    b"a = " + b"{a = " * 5_000,
    b"a = " + b"{a.b.c.d.e.f.g.h.i.j.k = " * 60 + b"1" + b"}" * 60,
    b"a = " + b"9" * 10_000,
    b"a = 1\n" * 200_000,
    b"a = nan",
    b"a = [1, {b = -inf}]",
    b"a = 1\na = 2",
    "a = 'Bahn über Land'".encode("latin-1"),
    "a = 1".encode("utf-16"),
    "a = 1".encode("utf-16-le"),
    "a = 1".encode("utf-32"),
]


@pytest.mark.parametrize("data", HOSTILE)
def test_hostile_toml_is_one_sentence_at_once(data):
    start = time.monotonic()
    with pytest.raises(UserError) as caught:
        parse_toml(data, "mine.toml")
    assert time.monotonic() - start < 5
    assert str(caught.value).startswith("mine.toml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("reader", READERS)
def test_every_reader_has_the_guard(reader, tmp_path):
    path = tmp_path / "mine.toml"
    for data, says in (
        (HOSTILE[0], "16 dots"),
        (HOSTILE[5], "64 brackets"),
        (b"a = inf", "key a is inf"),
        ("a = 1".encode("utf-16"), "UTF-16"),
        (b"#" * (MAX_TOML_BYTES + 1), "smaller"),
        (b"\xef\xbb\xbfno_such_key = 1", "no_such_key"),
    ):
        path.write_bytes(data)
        with pytest.raises(UserError, match=says):
            reader(path)


def test_dots_in_text_are_no_key():
    text = "\ufeffa = '1.2'\nb = \"x.y\"\n[c.d]\ne.f = 1.5 # . . . . . . . . . . . . . . . . . . . .\n"
    assert parse_toml(text.encode(), "a") == {"a": "1.2", "b": "x.y", "c": {"d": {"e": {"f": 1.5}}}}


def test_no_other_module_parses_toml():
    root = Path(__file__).parents[3]
    sources = (
        path for top in ("flyaround", "simulator", "hil", "gui") for path in (root / top).rglob("*.py")
    )
    readers = {path.name for path in sources if "tomllib" in path.read_text(encoding="utf-8")}
    assert readers == {"toml_file.py"}
