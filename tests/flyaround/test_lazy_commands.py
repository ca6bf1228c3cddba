"""The command line imports a command when it is called, and knows them all by name."""

import sys

import pytest
from programs import completed
from typer.main import get_command
from typer.testing import CliRunner

import flyaround
from flyaround.cli.app import app


def _commands(group, *path):
    """Every command below a group: what its page lists, and under an own key what is called."""
    commands = {}
    for name, listed in group.commands.items():
        command = listed.make_context(name, [], resilient_parsing=True).command
        commands |= {(*path, name): (listed, command), **_commands_of(command, *path, name)}
    return commands


def _commands_of(command, *path):
    return _commands(command, *path) if hasattr(command, "commands") else {}


def test_help_lists_each_command_by_the_first_paragraph_of_its_own_help():
    commands = _commands(get_command(app))
    assert len(commands) > 35
    for path, (listed, command) in commands.items():
        assert command.help.partition("\n\n")[0] == listed.help.partition("\n\n")[0], path
    page = CliRunner().invoke(app, ["--help"], env={"COLUMNS": "200"}).output
    assert all(path[0] in page for path in commands)


@pytest.mark.parametrize("words", [["--help"], ["hil", "--help"], ["--version"], []])
def test_the_list_of_commands_imports_none_of_them(words):
    code = (
        "import sys, flyaround.__main__ as m; m.run(sys.argv[1:]); "
        "slow = ('numpy', 'scipy', 'cv2', 'moderngl', 'msgspec', 'matplotlib', 'flyaround.hil.host'); "
        "print([m for m in slow if m in sys.modules])"
    )
    done = completed(sys.executable, "-c", code, *words, check=True)
    assert done.stdout.strip().splitlines()[-1] == "[]"


@pytest.mark.parametrize(
    ("typed", "offered"), [("ca", "capture"), ("hil dis", "display-match"), ("hil host --li", "--listen")]
)
def test_the_shell_completes_commands_and_options(typed, offered):
    count = str(len(typed.split()))
    environment = {
        "_FLYAROUND_COMPLETE": "complete_bash",
        "COMP_WORDS": f"flyaround {typed}",
        "COMP_CWORD": count,
    }
    page = CliRunner().invoke(app, [], prog_name="flyaround", env=environment).output
    assert offered in page.split()


def test_the_help_of_the_loop_names_its_parts():
    page = " ".join(CliRunner().invoke(app, ["hil", "--help"]).output.split())
    for part in ("closed loop", "hil campaign", "delay map", "camera endpoint", "make board-qemu"):
        assert part in page


def test_a_misspelt_command_is_answered_with_the_nearest():
    result = CliRunner().invoke(app, ["rendr"])
    assert result.exit_code == 2
    assert "render" in result.output


def test_drawing_does_not_import_the_estimator_or_plots_or_what_writes_target_files():
    code = (
        "import sys; from flyaround.__main__ import run; run(['render', 'no-such-scenario', '-t', '3']); "
        "slow = ('flyaround.hil.board.svd', 'flyaround.hil.board.hybrid', 'flyaround.hil.host', "
        "'matplotlib', 'trimesh', 'pygltflib', 'pydantic'); "
        "print([m for m in slow if m in sys.modules])"
    )
    done = completed(sys.executable, "-c", code, check=True)
    assert done.stdout.strip().splitlines()[-1] == "[]"


def test_an_earth_scenarios_maps_are_begun_before_what_flies_and_draws_it_is_imported():
    code = (
        "import sys; import flyaround.simulator.render.earth.map_textures as earth_maps; "
        "from flyaround.__main__ import run; "
        "begin = lambda *_: print([m for m in ('scipy', 'moderngl') if m in sys.modules]) or sys.exit(7); "
        "earth_maps.prefetch_earth_maps = begin; sys.exit(run(['render', 'tango-flyaround', '-t', '0']))"
    )
    done = completed(sys.executable, "-c", code)
    assert (done.returncode, done.stdout.strip()) == (7, "[]")


def test_every_public_name_is_where_the_face_says():
    for name in flyaround.__all__:
        assert getattr(flyaround, name) is not None
    assert set(flyaround.__all__) <= set(dir(flyaround))
