"""``hil camera`` and ``hil host --listen gige://``: what is refused, and what is said before anybody listens."""

import pytest

from flyaround.__main__ import run
from flyaround.cli import hil_camera


@pytest.mark.parametrize(
    "words",
    [
        ["--mode", "realtime"],
        ["--truth", "off"],
        ["-n", "30"],  # also where it is what the default is
        ["--log", "run1"],
        ["--json"],
        ["--workers", "2"],
        ["--max-misses", "3"],
        ["--encoding", "raw", "--time-code"],
    ],
)
def test_what_is_about_a_link_is_refused_where_a_camera_is_served(words, capsys):
    assert run(["hil", "host", "tango-limb", "--listen", "gige://lo", *words]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert words[0] in said
    assert "use flyaround hil camera tango-limb --interface lo" in said
    assert said.count("flyaround: ") == 1


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--interface", "nothing0"], "no network interface 'nothing0'"),
        (["--interface", "lo", "--allow", "example.org"], "is not an IPv4 address"),
        (["--interface", "lo", "--log", "run1"], "give --answers"),
        (["--interface", "lo", "--answers", "udp://127.0.0.1:9"], "is not a TCP address"),
        # whoever connects is answered there: from elsewhere with a key alone
        (["--interface", "lo", "--answers", "tcp://0.0.0.0:5602"], "give both sides a key"),
        (["--interface", "lo", "--xml", "none.xml"], "cannot be read"),
    ],
)
def test_mistakes_are_told_in_one_sentence(words, sentence, capsys):
    assert run(["hil", "camera", "tango-limb", *words]) == 2
    assert sentence in " ".join(capsys.readouterr().err.split())


def test_the_interface_has_to_be_named(capsys):
    assert run(["hil", "camera", "tango-limb"]) == 2
    assert "--interface" in capsys.readouterr().err


def test_it_says_who_may_control_and_that_it_cannot_authenticate(monkeypatch, capsys):
    told = []

    def served(_pictures, config, *, on_opened, **_):
        told.append(config)
        on_opened(None)

    monkeypatch.setattr(hil_camera, "run_camera", served)
    monkeypatch.setattr(hil_camera, "render_loop", lambda *_, **__: None)
    assert run(["hil", "camera", "tango-limb", "--interface", "lo", "--loop", "1"]) == 0
    said = " ".join(capsys.readouterr().err.split())
    assert "It cannot authenticate" in said
    assert "controllers: 127.0.0.1." in said
    assert told[0].allowed == ("127.0.0.1",)
    words = ["--interface", "lo", "--loop", "1", "--allow", "192.168.10.7"]
    assert run(["hil", "camera", "tango-limb", *words]) == 0
    assert told[1].allowed == ("192.168.10.7",)
