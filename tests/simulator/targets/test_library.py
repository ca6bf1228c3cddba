"""Targets by name: built-in ones and their levels of detail."""

import time
from importlib import resources

import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.library import SUFFIX, built_in_targets, list_targets, load_target
from flyaround.simulator.targets.model import DETAILS, level_name, split_level

ASSETS = resources.files("flyaround.assets")


def test_unknown_name_offers_the_nearest():
    with pytest.raises(UserError, match=r"unknown target 'tengo': name one of tango"):
        load_target("tengo")
    assert list_targets() == built_in_targets()


@pytest.mark.parametrize("name", ["tango", "envisat@medium", "dragon", "calibration-board@low"])
def test_a_built_in_target_is_read_fast_and_without_a_cache(name, tmp_path, monkeypatch):
    monkeypatch.setenv("FLYAROUND_CACHE_DIR", str(tmp_path))
    spent = []
    for _ in range(3):
        start = time.process_time()
        assert load_target(name).name == name
        spent.append(time.process_time() - start)
    # 4 ms for Tango and 10 ms for Dragon here; a shared machine gets the whole allowance
    assert min(spent) < 0.3
    assert not list(tmp_path.iterdir())


def test_a_damaged_built_in_target_is_one_sentence(tmp_path, monkeypatch):
    assert "tango" in built_in_targets()
    file = tmp_path / "targets" / f"tango{SUFFIX}"
    file.parent.mkdir()
    monkeypatch.setattr(resources, "files", lambda _: tmp_path)
    with pytest.raises(UserError, match=r"tango.*cannot be read .*: install Flyaround again"):
        load_target("tango")
    packed = bytearray(ASSETS.joinpath("targets", file.name).read_bytes())
    for at in range(100, len(packed), len(packed) // 20):
        packed[at] ^= 1
        file.write_bytes(packed)
        with pytest.raises(UserError, match="install Flyaround again"):
            load_target("tango")
        packed[at] ^= 1


def test_level_names_round_trip():
    for level in DETAILS:
        assert split_level(level_name("tango", level)) == ("tango", level)
    assert split_level("a@b@low") == ("a@b", "low")
    assert split_level("tango@high") == ("tango@high", "full")


def test_a_level_is_asked_for_by_argument_or_name_and_recorded():
    low = load_target("tango", "low")
    assert low.name == "tango@low"
    assert load_target(low.name).sha256 == low.sha256
    assert load_target("tango@full").name == "tango"
    assert low.sha256 != load_target("tango").sha256
    with pytest.raises(UserError, match="no level 'coarse'"):
        load_target("tango", "coarse")  # type: ignore[arg-type]
    with pytest.raises(UserError, match=r"unknown target 'tango@coarse'.*tango"):
        load_target("tango@coarse")
