"""URLs are printed without what lets strangers in."""

import pytest

from flyaround.simulator.runtime.urls import without_secrets


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("ftp://user:secret@host/set", "ftp://***@host/set"),
        ("s3://user:p@ss@bucket/x?token=abc&y=1#k=2", "s3://***@bucket/x?token=***&y=***#k=***"),
        ("http://user:sec/ret@127.0.0.1:1/x", "http://***@127.0.0.1:1/x"),
        ("https://token@host/x", "https://***@host/x"),
        ("cannot reach 'ray://u:1a@h:1' (refused)", "cannot reach 'ray://***@h:1' (refused)"),
        ("serial:///dev/ttyUSB0?baud=9600&rtscts=1", "serial:///dev/ttyUSB0?baud=9600&rtscts=1"),
        ("tcp://127.0.0.1:5600", "tcp://127.0.0.1:5600"),
        ("s3://host:9000/a@b", "s3://host:9000/a@b"),
        ("/home/a@b/c is not empty", "/home/a@b/c is not empty"),
        ("memory://set", "memory://set"),
    ],
)
def test_secrets_are_not_printed(text, shown):
    assert without_secrets(text) == shown
