"""Files are whole or absent."""

import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import write_atomic, write_json
from tests.harness.full_device import FULL, needs_full_device


def test_nothing_is_left_when_the_parent_is_a_file(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(UserError, match="cannot write"):
        write_atomic(tmp_path / "file" / "child.json", b"{}")
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_json_keeps_every_bit_of_a_float(tmp_path):
    import json

    value = 0.1 + 0.2
    write_json(tmp_path / "a.json", {"x": value})
    assert json.loads((tmp_path / "a.json").read_text())["x"] == value
    with pytest.raises(ValueError, match="JSON"):
        write_json(tmp_path / "b.json", {"x": float("nan")})
    assert not (tmp_path / "b.json").exists()


@needs_full_device
def test_a_full_disk_is_said_as_one(tmp_path):
    import os
    from pathlib import Path

    from flyaround.simulator.errors import machine_sentence, write_error

    handle = os.open(FULL, os.O_WRONLY)
    with pytest.raises(OSError, match="No space left") as full:
        os.write(handle, b"x")
    os.close(handle)
    text = str(write_error(Path("/data/set/a.png"), full.value))
    assert text == (
        "cannot write /data/set/a.png: no space left on its disk; free some space or choose another disk"
    )
    assert "may write to" in str(write_error(Path("a"), PermissionError(13, "Permission denied")))
    assert "free some space" in machine_sentence(full.value)
    named = OSError(28, "No space left on device", "/data/x.csv")
    assert machine_sentence(named).startswith("no space left on the disk: /data/x.csv;")
