"""What is kept of the console's layout is read with care."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from flyaround.gui.layout import LARGEST_BYTES, SavedLayout, layout_file, read_layout
from tests.harness.pointer import Pointer


def test_a_layout_is_read_again(tmp_path: Path) -> None:
    path = tmp_path / "console.json"
    kept = SavedLayout(shown={"log": True}, docking={"wide": "[Window][log]\n"})
    path.write_bytes(msgspec.json.encode(kept))
    assert read_layout(path) == kept


@pytest.mark.parametrize(
    "data", [b"", b"{", b"[]", b'{"version": 99}', b'{"font_scale": 1e9}', b" " * (LARGEST_BYTES + 1)]
)
def test_a_damaged_layout_is_the_first_layout(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "console.json"
    path.write_bytes(data)
    assert read_layout(path) == SavedLayout()


def test_no_layout_is_the_first_layout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FLYAROUND_CONSOLE_LAYOUT", str(tmp_path / "none.json"))
    assert read_layout(layout_file()) == SavedLayout()


def test_a_window_that_is_resized_does_not_take_letters_from_a_field() -> None:
    """A new form raises its tabs, but not over the search for a command: letters would act as keys."""
    screen = Pointer()
    imgui = screen.window.plain
    screen.console.open_panel("keys", shown=True)
    screen.window.size = (640, 480)
    imgui.get_io().display_size = imgui.ImVec2(640, 480)
    for _ in range(14):
        screen.turn()
    assert imgui.get_io().want_text_input
    screen.close()
