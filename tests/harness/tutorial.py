"""Runs a tutorial page as a reader would: its files are written, its shell blocks run one after another."""

import os
import re
import subprocess
import sys
from pathlib import Path

# ```LANGUAGE title="NAME" ... ```
BLOCK = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)
PATIENCE_S = 240


def blocks(page: Path) -> list[tuple[str, str, str]]:
    """Language, title and text of each code block of a page, in order."""
    return BLOCK.findall(page.read_text(encoding="utf-8"))


def run_tutorial(page: Path, folder: Path, environment: dict[str, str] | None = None) -> str:
    """Everything that the page's commands print, with each command's failure as an assertion.

    A shell block with a title is one of several terminals: it runs beside the next block, and ends with it.
    """
    paths = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
    env = {**os.environ, "PATH": paths, **(environment or {})}
    printed, terminals = [], []
    for language, title, text in blocks(page):
        if language != "sh":
            (folder / title).write_text(text, encoding="utf-8")
            continue
        process = subprocess.Popen(
            ["bash", "-euo", "pipefail", "-c", text],
            cwd=folder,
            env=env,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        terminals.append((text, process))
        if title and len(terminals) == 1:
            continue
        for block, running in terminals:
            out, _ = running.communicate(timeout=PATIENCE_S)
            assert running.returncode == 0, f"{block}\n{out}"
            printed.append(out)
        terminals = []
    assert not terminals
    return "".join(printed)
