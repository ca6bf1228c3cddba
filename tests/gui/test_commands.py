"""The command table and scripts: one name and key each, arguments read and refused, a log that flies again."""

from __future__ import annotations

from pathlib import Path

import pytest

from flyaround.gui import style
from flyaround.gui.app import command_table
from flyaround.gui.command_table import Argument, Command, CommandTable, line_of
from flyaround.gui.console import LONGEST_TICK_MS, STEERING
from flyaround.gui.jobs.all import running_jobs
from flyaround.gui.operator_state import MODIFIERS
from flyaround.gui.panels import steering
from flyaround.gui.panels.all import PANELS
from flyaround.gui.panels.help import GROUPS
from flyaround.gui.panels.key_list import matches
from flyaround.gui.script import LARGEST_BYTES, Script
from flyaround.gui.status_line import message_texts
from flyaround.gui.texts import texts
from flyaround.simulator.camera.lens.files import list_cameras
from flyaround.simulator.errors import UserError
from tests.harness.flown_console import console_flying
from tests.harness.full_device import FULL, needs_full_device


@pytest.fixture(scope="module")
def table() -> CommandTable:
    return command_table()


def test_every_command_has_words_and_no_key_is_of_two(table: CommandTable) -> None:
    # the table itself refuses two of a name or key
    for command in table:
        assert command.help, command.name
        assert command.title, command.name
        assert command.name == command.name.lower()
        assert not (command.held and command.arguments)
    assert frozenset(c.name for c in table if c.held) == STEERING | {f"steer.{name}" for name in MODIFIERS}
    assert {f"panel.{p.name}" for p in PANELS} <= {c.name for c in table}


def test_every_text_is_of_a_command(table: CommandTable) -> None:
    assert set(texts("commands")) <= {c.name for c in table}


def test_the_help_of_a_panel_names_groups_that_there_are(table: CommandTable) -> None:
    groups = {c.group for c in table}
    assert {g for named in GROUPS.values() for g in named} <= groups


def test_two_commands_of_one_key_are_refused() -> None:
    with pytest.raises(ValueError, match="key a is of"):
        CommandTable(Command(n, n, n, print, ("a",)) for n in ("x.one", "x.two"))


def test_a_chord_takes_the_key_from_its_letter(table: CommandTable) -> None:
    assert [c.name for c in table.pressed(["p"], ctrl=False)] == ["picture.save"]
    assert [c.name for c in table.pressed(["p"], ctrl=True)] == ["panel.keys"]
    # Ctrl is a modifier of steering too, so other keys keep their meaning
    assert [c.name for c in table.pressed(["space"], ctrl=True)] == ["time.pause"]


MODES = {"steer.stop", *(f"guidance.{name}" for name in steering.MODES.split())}


def test_every_switch_switches_there_and_back(table: CommandTable) -> None:
    console = console_flying(table=table)
    console.do("steer.toggle")
    for command in table:
        # a mode stays on until another one begins
        if command.state is None or not command.at_once or command.name in MODES:
            continue
        before = command.state(console)
        console.do(command.name)
        assert command.state(console) != before, command.name
        console.do(command.name)
        assert command.state(console) == before, command.name
        if command.arguments:
            console.do(command.name, True)
            assert command.state(console), command.name
    assert [m for m in console.messages if m.level != "note"] == []


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("1.0 time.rat 3", "no command"),
        ("1.0 time.rate 3", "allowed: 0.1"),
        ("1.0 time.rate", "needs rate"),
        ("1.0 picture.exposure nan", "allowed: a number from"),
        ("1.0 picture.exposure 1e3", "from -8 to 8"),
        ("1.0 overlay.hud maybe", "on, off"),
        (f"1.0 scenario.back {'9' * 400}", "allowed: a whole number from 1 to 99"),
        ("nan time.pause", "a line is"),
        ("-1 time.pause", "a line is"),
        ("1.0", "a line is"),
        ("1.0 steer.forward", "hold steer.forward"),
        ("1.0 hold time.pause", "held command"),
        ("1.0 log.save 'a", "quotes"),
        ("0.5 time.pause", "comes after"),
    ],
)
def test_a_wrong_line_is_told_with_its_number(table: CommandTable, line: str, why: str) -> None:
    with pytest.raises(UserError, match=r"line 3: .*" + why):
        Script.parse(f"# a script\n0.9 time.pause\n{line}\n", table)


def test_a_script_that_cannot_be_read_is_told(table: CommandTable, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="cannot read"):
        Script.read(tmp_path / "none.script", table)
    large = tmp_path / "large.script"
    large.write_bytes(b"#" * (LARGEST_BYTES + 1))
    with pytest.raises(UserError, match="larger than"):
        Script.read(large, table)


def test_a_script_may_begin_with_a_byte_order_mark(table: CommandTable, tmp_path: Path) -> None:
    path = tmp_path / "windows.script"
    path.write_bytes("0.9 time.pause\r\n".encode("utf-8-sig"))
    assert Script.read(path, table) == Script.parse("0.9 time.pause\n", table)


def test_a_log_played_again_flies_the_same_flight(table: CommandTable) -> None:
    # uneven turns of the loop, keys and commands at odd times
    console = console_flying(table=table)
    turns = [17, 33, 34, 16, 250, 8, 41] * 60
    keys = {20: {"steer.forward"}, 90: {"steer.forward", "steer.yaw-left", "steer.fine"}, 150: set()}
    down: frozenset[str] = frozenset()
    for k, turn in enumerate(turns):
        console.pass_time(turn, down)
        down = frozenset(keys.get(k, down))
        if k == 200:
            console.do("time.rate", "5")
        if k == 260:
            console.do("steer.stop")
        if k == 300:
            console.do("time.pause")
        if k == 310:
            console.do("time.pause")
    text = console.log.text(("flown by hand",))
    again = console_flying(table=table)
    again.play(Script.parse(text, table))
    while again.clock_ms < console.clock_ms:
        again.pass_time(min(29, console.clock_ms - again.clock_ms))
    assert again.log.text(("flown by hand",)) == text
    assert again.session.t_s == console.session.t_s
    assert again.session.craft.world == console.session.craft.world


def test_a_stalled_window_is_not_made_up_for(table: CommandTable) -> None:
    console = console_flying(table=table)
    console.pass_time(30_000)
    assert console.clock_ms == LONGEST_TICK_MS


def test_a_command_that_fails_is_a_message_and_the_flight_goes_on(
    table: CommandTable, tmp_path: Path
) -> None:
    console = console_flying(table=table)
    (tmp_path / "file").write_text("")
    console.do("log.save", str(tmp_path / "file" / "x.script"))
    assert [m.level for m in console.messages] == ["caution"]
    console.do_line("log.save 'half")
    console.do_line("nothing.at-all")
    assert len(console.messages) == 3
    console.pass_time(100)
    console.do("window.acknowledge")
    assert console.messages.waiting == []


def test_numbers_are_written_so_that_they_are_read_again() -> None:
    argument = Argument("x", "number", "")
    for value in (0.1 + 0.2, -1e-12, 3.0, 1 / 3):
        _, word = line_of("a.b", (value,)).split()
        assert argument.read(word, "a.b") == value


def test_commands_are_found_by_words_of_their_help(table: CommandTable) -> None:
    found = [c.name for c in table if matches(c, "brake LVLH")]
    assert found == ["steer.stop"]


def test_a_log_is_in_its_file_as_soon_as_a_command_is_done(table: CommandTable, tmp_path: Path) -> None:
    console = console_flying(table=table)
    path = tmp_path / "logs" / "flown.script"
    console.log.write_to(path, ("played by a test",))
    console.pass_time(100)
    console.do("time.rate", "2")
    assert path.read_text() == "# played by a test\n0.100 time.rate 2\n"
    console.do("steer.arm", True)
    console.pass_time(100, frozenset({"steer.up"}))
    console.pass_time(100)
    assert [str(line) for line in Script.read(path, table).lines] == [str(line) for line in console.log.lines]
    console.close()


def test_a_log_that_cannot_be_written_is_refused_in_one_sentence(table: CommandTable, tmp_path: Path) -> None:
    (tmp_path / "taken").touch()
    with pytest.raises(UserError, match="cannot write the log"):
        console_flying(table=table).log.write_to(tmp_path / "taken" / "x.script")


@needs_full_device
def test_a_full_disk_ends_the_logs_file_and_not_the_abort(table: CommandTable) -> None:
    console = console_flying(table=table)
    with pytest.raises(UserError, match="cannot write the log"):
        console.log.write_to(FULL, ("header",))
    console.log.write_to(FULL)
    console.do("docking.abort")
    assert console.session.craft.steering.doing == "abort"
    assert any("can no longer be written" in m.text for m in console.messages)
    console.do("time.rate", "1")


def test_no_output_replaces_a_file(
    table: CommandTable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    console = console_flying(table=table)
    for taken in ("view.mp4", "look.png", "done.script", "mine.toml"):
        Path(taken).write_text("precious")
    console.draft.edit("tango-flyaround")
    for line in (
        "film.start view.mp4",
        "window.screenshot look.png",
        "log.save done.script",
        "scenario.save mine.toml",
    ):
        console.do_line(line)
        assert "exists already" in console.messages[-1].text
        assert (tmp_path / line.split()[1]).read_text() == "precious"
    with pytest.raises(UserError, match="exists already"):
        console.log.write_to(tmp_path / "done.script")
    # without a name each gets a new one, and a draft is saved again to its own file
    console.do("log.save")
    console.do("log.save")
    assert sorted(p.name for p in Path("out/console").iterdir()) == ["commands-2.script", "commands.script"]
    console.do("scenario.save", "new.toml")
    console.do("scenario.save", "new.toml")
    assert console.messages[-1].level == "note"
    console.close()


def test_keys_fly_only_while_hand_control_is_armed(table: CommandTable) -> None:
    console = console_flying(table=table)
    stop = table["steer.stop"]
    for held in (frozenset({"steer.up"}), frozenset({"steer.coarse"})):
        console.pass_time(100, held)
    console.press([stop])
    assert console.session.craft.mode == "guidance"
    assert [m.text for m in console.messages] == [
        "keys, mouse and gamepad do not fly: arm hand control first (Ctrl+H or Insert)",
        "Stop: keys, mouse and gamepad do not fly: arm hand control first (Ctrl+H or Insert)",
    ]
    console.do("steer.arm", True)
    console.press([stop])
    assert console.session.craft.mode == "steer"


def test_restart_says_how_the_flight_comes_back() -> None:
    console = console_flying("tango-space-10m")
    for _ in range(10):
        console.pass_time(200)
    flown_s = console.session.t_s
    console.do("time.restart")
    assert console.session.t_s == 0.0
    assert "Swap future" in console.messages[-1].text
    console.do("timeline.other-future")
    assert console.session.look_back.timeline.end_s == pytest.approx(flown_s)


def test_the_panel_of_a_data_set_opens_with_the_click_and_not_when_the_flight_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    console = console_flying("tango-space-10m")
    for _ in range(10):
        console.pass_time(200)
    console.do("timeline.dataset", 1)
    assert console.shown["capture"]
    assert running_jobs(console.jobs)[-1].text.startswith("writing the flight, 0%")
    console.window.front = ""
    console.table = CommandTable(c for c in console.table if c.name != "capture.start")
    while console.jobs.keeping:
        console.pass_time(50)
    assert "there is no command 'capture.start'" in console.messages[-1].text
    assert console.window.front == ""


def test_reset_sensor_takes_back_camera_and_noise_too(table: CommandTable) -> None:
    console = console_flying(table=table)
    settings = console.options.settings
    console.do("camera.use", list_cameras()[0])
    console.do("picture.noise", False)
    console.do("sensor.set", "gaussian_variance", 0.003)
    assert settings.camera is not None
    console.do("sensor.reset")
    assert (settings.camera, settings.noise, settings.sensor_changes) == (None, True, {})


def test_another_layout_than_dock_closes_the_docking_display(table: CommandTable) -> None:
    console = console_flying(table=table)
    console.options.overlays.docking = True
    console.do("layout.dock")
    assert console.options.overlays.docking
    console.do("layout.fly")
    assert not console.options.overlays.docking


def test_the_end_of_a_jump_is_told_once() -> None:
    console = console_flying("tango-eclipse-pass")
    console.do("time.next-eclipse")
    while console.session.clock.jump:
        console.pass_time(50)
    for _ in range(3):
        console.pass_time(50)
    ends = [m.text for m in console.messages if m.text.startswith("the jump has ended")]
    assert len(ends) == 1
    assert console.messages[-1].text == ends[0]
    console.close()


def test_a_refused_command_leaves_guidance_and_asks_nothing_at_quit(table: CommandTable) -> None:
    console = console_flying(table=table)
    console.pass_time(200)
    for line in (
        "guidance.waypoint 0 0 0",
        "burn.plan 0 0 1 0",
        "docking.go",
        "timeline.seek nan",
        "timeline.other-future",
    ):
        console.do_line(line)
        level = "note" if line.startswith("timeline") else "caution"
        assert console.messages[-1].level == level, line
        assert console.flown_by == "scenario's guidance", line
        assert not console.session.clock.paused, line
        assert console.losses == [], line


def test_flying_on_begins_at_no_more_than_real_time(table: CommandTable) -> None:
    console = console_flying(table=table)
    for _ in range(10):
        console.pass_time(200)
    console.do("time.rate", "100")
    console.do("timeline.seek", 1.0)
    console.do("timeline.fly-on")
    assert console.session.clock.rate == 1.0
    assert not console.session.clock.paused


def test_a_caution_stays_in_the_last_line_beside_an_ordinary_message(table: CommandTable) -> None:
    console = console_flying(table=table)
    console.say("the plume strikes", "caution")
    console.say("guidance: V-bar")
    caution = "the plume strikes (F9: seen)", style.WARN
    assert message_texts(console) == [caution, ("guidance: V-bar", style.INK)]
    console.say("too near", "warning")
    assert message_texts(console) == [("too near (F9: seen)", style.BAD), ("the plume strikes", style.WARN)]
    console.messages.acknowledge()
    # what is over must not read as if it were not
    assert message_texts(console) == [("guidance: V-bar", style.QUIET)]
    console.say("guidance: R-bar")
    assert message_texts(console) == [("guidance: R-bar", style.QUIET)]
