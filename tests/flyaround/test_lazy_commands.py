"""The command line imports a command when it is called, and knows them all by name."""

from __future__ import annotations

import importlib
import subprocess
import sys

from typer.testing import CliRunner

import flyaround
from flyaround.cli.app import COMMANDS, GROUPS, app


def test_help_names_every_command_and_each_is_there() -> None:
    page = CliRunner().invoke(app, ["--help"]).output
    for name, module in COMMANDS.items():
        assert name in page
        assert callable(getattr(importlib.import_module(f"flyaround.cli.{module}"), name))
    assert all(name in page for name in GROUPS)
    assert CliRunner().invoke(app, ["hil", "board", "--help"]).exit_code == 0


def test_the_help_of_the_loop_names_its_parts() -> None:
    page = " ".join(CliRunner().invoke(app, ["hil", "--help"]).output.split())
    for part in ("closed loop", "hil campaign", "delay map", "camera endpoint", "make board-qemu"):
        assert part in page


def test_a_misspelt_command_is_answered_with_the_nearest() -> None:
    result = CliRunner().invoke(app, ["rendr"])
    assert result.exit_code == 2
    assert "render" in result.output


def test_drawing_does_not_import_the_estimator_or_plots_or_what_writes_target_files() -> None:
    code = (
        "import sys; from flyaround.__main__ import run; run(['render', 'no-such-scenario', '-t', '3']); "
        "slow = ('flyaround.hil.board.svd', 'flyaround.hil.board.hybrid', 'flyaround.hil.host', "
        "'matplotlib', 'trimesh', 'pygltflib', 'pydantic'); "
        "print([m for m in slow if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip().splitlines()[-1] == "[]"


def test_an_earth_scenarios_maps_are_begun_before_what_flies_and_draws_it_is_imported() -> None:
    code = (
        "import sys; import flyaround.simulator.render.earth.map_textures as earth_maps; "
        "from flyaround.__main__ import run; "
        "begin = lambda *_: print([m for m in ('scipy', 'moderngl') if m in sys.modules]) or sys.exit(7); "
        "earth_maps.prefetch_earth_maps = begin; sys.exit(run(['render', 'tango-flyaround', '-t', '0']))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.strip()) == (7, "[]")


def test_every_public_name_is_where_the_face_says() -> None:
    for name in flyaround.__all__:
        assert getattr(flyaround, name) is not None
    assert set(flyaround.__all__) <= set(dir(flyaround))
