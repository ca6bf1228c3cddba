"""The console is an extra: the command line lives without it, and says how to get it."""

from __future__ import annotations

import subprocess
import sys

import pytest

from flyaround.gui.surface import import_parts
from flyaround.simulator.errors import UserError


@pytest.mark.parametrize("part", ["glfw", "imgui_bundle", "OpenGL"])
def test_a_missing_part_is_one_sentence(part: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, part, None)
    with pytest.raises(UserError, match=r"pip install 'flyaround\[gui\]'") as caught:
        import_parts()
    assert part in str(caught.value)


def test_the_command_line_does_not_load_the_console() -> None:
    code = (
        "import sys, flyaround.cli; "
        "print([m for m in sys.modules if m.split('.')[0] in ('gui', 'glfw', 'imgui_bundle', 'OpenGL')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
