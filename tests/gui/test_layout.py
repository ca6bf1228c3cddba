"""What is kept of the console's layout is read with care."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from flyaround.gui.layout import LARGEST_BYTES, SavedLayout, layout_file, read_layout
from flyaround.gui.style import PRIMARY, Rgba, apply_style
from flyaround.gui.texts import texts
from flyaround.gui.widgets import Widgets
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


@pytest.mark.parametrize("tour", [False, True], ids=("alone", "with the tour"))
@pytest.mark.parametrize("size", [(1280, 800), (800, 600)], ids=("wide", "narrow"))
def test_a_layout_brings_its_task_to_the_front(size: tuple[int, int], *, tour: bool) -> None:
    screen = Pointer(size=size, opened=("tour",) * tour)
    for name, panels in texts("layouts").items():
        task = next(p.name for p in screen.layout.panels if p.name in panels and p.place == "left")
        # opened last, and so in front of others of its place
        screen.console.do("panel.plots", True)
        screen.turn()
        screen.console.do(f"layout.{name}")
        for _ in range(14):
            screen.turn()
        assert task not in screen.console.help.behind, name
        if tour and size[0] > 900:
            assert "tour" not in screen.console.help.behind, name
    screen.close()


def test_a_layout_comes_to_the_front_while_a_dialog_is_open() -> None:
    screen = Pointer(opened=("tour",))
    screen.console.open_panel("keys", shown=True)
    screen.turn()
    screen.console.do("layout.link")
    for _ in range(14):
        screen.turn()
    assert "board-link" not in screen.console.help.behind
    screen.close()


@pytest.mark.parametrize("tour", [False, True], ids=("alone", "with the tour"))
def test_the_first_layout_uses_the_middle_of_the_window(*, tour: bool) -> None:
    screen = Pointer("tango-flyaround", opened=("tour",) * tour)
    _, _, wide, tall = screen.rect("camera")
    assert wide > 890.0
    # the picture, and six lines of figures below or over it
    assert 5 * 18.0 < tall - wide / 1.6 < 8 * 18.0 or tour
    screen.close()


def test_no_tab_cuts_its_title() -> None:
    screen = Pointer()
    apply_style(screen.window.plain, 1.0)
    for panel in screen.layout.panels:
        if panel.place != "over":
            screen.console.do(f"panel.{panel.name}", True)
            screen.turn()
    for _ in range(12):
        screen.turn()
    inner = screen.window.plain.internal
    for panel in screen.layout.panels:
        if panel.place in {"over", "centre"}:
            continue
        native = inner.find_window_by_name(f"{panel.title}###{panel.name}")
        found = inner.tab_bar_find_tab_by_id(native.dock_node.tab_bar, native.tab_id)
        assert found.width >= found.content_width - 1.0, panel.title
    screen.close()


def bright(screen: Pointer, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Draw once more; return the labels of primary buttons that can be clicked."""
    labels: list[str] = []
    real = Widgets.filled_button

    def filled_button(w: Widgets, label: str, width: float, fill: Rgba | None) -> bool:
        if fill == PRIMARY and screen.window.plain.get_style().alpha == 1.0:
            labels.append(label.partition("###")[2].split()[0])
        return real(w, label, width, fill)

    with monkeypatch.context() as patched:
        patched.setattr(Widgets, "filled_button", filled_button)
        screen.turn()
    return labels


def test_each_layout_has_one_bright_button_at_most(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Pointer("tango-vbar-approach", opened=("tour",))
    found = {}
    for name in ("first", *texts("layouts")):
        screen.console.do(f"layout.{name}")
        for _ in range(14):
            screen.turn()
        found[name] = bright(screen, monkeypatch)
    screen.console.do("layout.dock")
    screen.console.do("docking.approach", True)
    for _ in range(14):
        screen.turn()
    assert bright(screen, monkeypatch) == ["docking.go"]
    assert found == {
        "first": [],
        "fly": [],
        "dock": ["docking.approach"],
        "capture": ["capture.start"],
        "estimate": ["estimator.run"],
        "link": ["hil.start"],
    }
    screen.close()
