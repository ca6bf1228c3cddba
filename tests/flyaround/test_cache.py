"""The command that lists and clears the cache."""

import json

from flyaround.__main__ import run


def test_the_cache_is_listed_and_cleared(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("FLYAROUND_CACHE_DIR", str(tmp_path))
    (tmp_path / "maps-0123456789abcdef0123.npy").write_bytes(bytes(2_000_000))
    assert run(["cache", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["size_bytes"] == 2_000_000
    assert found["kinds"] == [{"name": "maps", "files": 1, "size_bytes": 2_000_000}]
    assert run(["cache"]) == 0
    assert "maps" in capsys.readouterr().out
    assert run(["cache", "--clear"]) == 0
    assert "removed 2 MB" in capsys.readouterr().out
    assert list(tmp_path.iterdir()) == []


def test_a_wrong_size_is_one_sentence(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("FLYAROUND_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("FLYAROUND_CACHE_MB", "lots")
    assert run(["cache"]) == 2
    assert "FLYAROUND_CACHE_MB" in capsys.readouterr().err
