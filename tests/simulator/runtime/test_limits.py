"""Limits of the shell that a command cannot live with are said before a library meets them."""

import resource
import sys

import pytest
from programs import completed

from flyaround.simulator.errors import machine_sentence
from flyaround.simulator.runtime.limits import MIN_FILES, limits_problem

GB = 2**30


@pytest.mark.parametrize(
    ("name", "limit", "drawing", "words"),
    [
        ("RLIMIT_NOFILE", 24, False, "24 open files"),
        ("RLIMIT_NOFILE", MIN_FILES, True, None),
        ("RLIMIT_AS", GB, True, "1024 MiB of memory"),
        ("RLIMIT_AS", GB, False, None),
        ("RLIMIT_AS", GB // 2, False, "512 MiB of memory"),
        ("RLIMIT_AS", resource.RLIM_INFINITY, True, None),
    ],
)
def test_low_limits_are_said(
    monkeypatch,
    name,
    limit,
    drawing,
    words,
):
    given = {getattr(resource, name): limit}
    monkeypatch.setattr(resource, "getrlimit", lambda kind: (given.get(kind, resource.RLIM_INFINITY),) * 2)
    problem = limits_problem(drawing=drawing)
    assert (problem is None) == (words is None)
    assert words is None or words in str(problem)


@pytest.mark.parametrize("limits", [("-n", "24"), ("-v", "1048576"), ("-v", "524288")])
def test_a_command_under_a_low_limit_ends_in_one_sentence(limits):
    command = f"ulimit {' '.join(limits)}; exec {sys.executable} -m flyaround render tango-flyaround -o x.png"
    ended = completed("bash", "-c", command)
    assert ended.returncode == 2
    assert ended.stderr.startswith("flyaround: this shell allows")
    assert ended.stderr.strip().count("\n") == 0


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (MemoryError("OpenGL, after start-up"), "not enough memory (OpenGL"),
        (RuntimeError("can't start new thread"), "limits are reached: can't start new thread"),
        (ImportError("libx.so: failed to map segment from shared object"), "limits are reached"),
        (ImportError("No module named 'x'"), "cannot be loaded: No module named 'x'"),
        (OSError(24, "Too many open files"), "Too many open files"),
        (ConnectionRefusedError(111, "Connection refused"), "Connection refused"),
    ],
)
def test_what_a_machine_refuses_is_one_sentence(error, words):
    assert words in str(machine_sentence(error))


def test_a_bug_stays_one():
    assert machine_sentence(KeyError("x")) is None
