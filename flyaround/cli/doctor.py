"""doctor: OpenGL, the estimator's library and optional parts of this machine, and how to install the missing ones."""

from __future__ import annotations

import importlib.util
import json
import os
import platform
import shutil
import sys
from dataclasses import asdict, dataclass
from typing import Annotated

import numpy as np
import typer
from rich.table import Table
from rich.text import Text

from flyaround.cli.terminal import say, terminal
from flyaround.hil.board.errors import KernelError
from flyaround.hil.board.hybrid.native.library import describe_library, library
from flyaround.simulator.errors import UserError
from flyaround.simulator.geometry.ray_cast import has_embree
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.runtime.cache import cache_folder
from flyaround.simulator.runtime.cache_contents import cache_kinds


def doctor(as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False) -> None:
    """Report OpenGL, GPU and optional parts of this machine, and how to install the missing ones."""
    findings = examine()
    if as_json:
        typer.echo(json.dumps([asdict(f) for f in findings], indent=1))
    else:
        table = Table("part", "state")
        for f in findings:
            table.add_row(f.part, Text(f.found, "green" if f.ok else "red"))
        terminal().print(table)
        # below the table, so that a command can be copied in one piece
        for f in findings:
            if f.advice:
                say(f"- {f.part}: {f.advice}")
    if not all(f.ok or not f.required for f in findings):
        raise typer.Exit(1)


@dataclass(frozen=True)
class Finding:
    """State of one part of the machine.

    Parameters
    ----------
    part : str
        Name of the part.
    ok : bool
        True if the part is usable.
    required : bool
        True if Flyaround does not work without the part.
    found : str
        Version or state that was detected.
    advice : str
        How to install the part; empty if it is usable.
    """

    part: str
    ok: bool
    required: bool
    found: str
    advice: str


def examine() -> tuple[Finding, ...]:
    """Examine Python, OpenGL, the screen and the optional dependencies."""
    return (_python(), _opengl(), _rays(), _library(), _cache(), _screen(), *_optional())


def _python() -> Finding:
    version = platform.python_version()
    return Finding("Python", sys.version_info >= (3, 11), True, f"{version}, numpy {np.__version__}", "")


def _opengl() -> Finding:
    try:
        with Renderer() as renderer:
            info = renderer.info
    except UserError as error:
        return Finding("OpenGL through EGL", False, True, "none", str(error))
    kind = "software" if info.is_software else "hardware"
    return Finding("OpenGL through EGL", True, True, f"{info.renderer}, {info.version} ({kind})", "")


def _rays() -> Finding:
    installed = has_embree()
    ray_caster = "Embree" if installed else "a grid in numpy"
    advice = "the first picture of a new target takes a minute longer: pip install embreex"
    return Finding("rays for baked light", installed, False, ray_caster, "" if installed else advice)


def _library() -> Finding:
    part = "estimator's library"
    try:
        library()
    except KernelError as error:
        return Finding(part, False, False, "none", str(error))
    return Finding(part, True, False, describe_library(), "")


def _cache() -> Finding:
    cache_text = (
        f"{cache_folder()}, {sum(kind.size_bytes for kind in cache_kinds()) / 1e6:.0f} MB (flyaround cache)"
    )
    return Finding("cache", True, False, cache_text, "")


def _screen() -> Finding:
    display = os.environ.get("WAYLAND_DISPLAY") or os.environ.get("DISPLAY")
    advice = "needed for the window only: start under X or Wayland, or use xvfb-run"
    return Finding("screen", bool(display), False, display or "none", "" if display else advice)


def _optional() -> list[Finding]:
    rows = []
    for module, part, advice in (
        ("glfw", "window (glfw)", "pip install 'flyaround[gui]'"),
        ("imgui_bundle", "panels (imgui-bundle)", "pip install 'flyaround[gui]'"),
        ("serial", "serial lines (pyserial)", "pip install pyserial"),
        ("zstandard", "compression (zstandard)", "pip install zstandard"),
    ):
        installed = importlib.util.find_spec(module) is not None
        rows.append(
            Finding(
                part, installed, False, "installed" if installed else "missing", "" if installed else advice
            )
        )
    for program, use in (("Xvfb", "tests of the window"), ("gcc", "the C decoder test")):
        installed = shutil.which(program) is not None
        advice = "" if installed else f"needed for {use} only: apt-get install {program.lower()}"
        rows.append(Finding(program, installed, False, "installed" if installed else "missing", advice))
    return rows
