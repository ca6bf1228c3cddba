"""Files are whole or absent."""

import pytest

from simulator.errors import UserError
from simulator.files import write_atomic, write_json


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
