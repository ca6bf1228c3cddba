"""Dear ImGui without a window or a driver: panels are laid out as in the console, and what they lay out is noted."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from flyaround.gui.surface import import_parts

CONTROLS = frozenset(
    {
        *(
            "button",
            "small_button",
            "image_button",
            "checkbox",
            "selectable",
            "combo",
            "slider_float",
            "slider_int",
        ),
        *("input_text", "input_text_with_hint", "input_text_multiline", "input_int", "input_double"),
        *(
            "input_float3",
            "drag_float",
            "drag_float3",
            "progress_bar",
            "image",
            "end_plot",
            "menu_item_simple",
        ),
    }
)
TEXTS = frozenset({"text_unformatted"})
FIGURE = re.compile(r"\d")
ICON = re.compile("^[\ue000-\uf8ff]\\s*")


@dataclass
class Noted:
    """What was laid out, in its order.

    Parameters
    ----------
    what : control, text or tip.
    label : its text.
    middle : its position.
    """

    what: str
    label: str
    middle: tuple[float, float] = (0.0, 0.0)


class NotedModule:
    """``imgui`` or ``implot``, whose controls and texts are noted when they are laid out."""

    def __init__(self, module: Any, noted: list[Noted]) -> None:
        self._module, self._noted = module, noted

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._module, name)
        if name not in CONTROLS | TEXTS:
            return found

        def call(*arguments: Any, **options: Any) -> Any:
            label = str(arguments[0]) if arguments and name not in {"progress_bar", "image"} else name
            label = ICON.sub("", label.lstrip() if name in CONTROLS else label)
            given = found(*arguments, **options)
            if hasattr(self._module, "get_item_rect_min"):
                low, high = self._module.get_item_rect_min(), self._module.get_item_rect_max()
                middle = (low.x + high.x) / 2, (low.y + high.y) / 2
            else:
                middle = (0.0, 0.0)
            self._noted.append(Noted("control" if name in CONTROLS else "text", label, middle))
            return given

        return call


@dataclass
class HeadlessWindow:
    """What panels need of `flyaround.gui.window.Window`; nothing is drawn, a picture is a number."""

    size: tuple[int, int] = (1280, 800)
    scale: float = 1.0
    software: bool = False
    flaw: str = ""
    noted: list[Noted] = field(default_factory=list)

    def __post_init__(self) -> None:
        bundle, _ = import_parts()
        self.plain, self.ctx = bundle.imgui, bundle.imgui_ctx
        self.imgui, self.implot = (NotedModule(m, self.noted) for m in (bundle.imgui, bundle.implot))
        imgui = bundle.imgui
        self._contexts = imgui.create_context(), bundle.implot.create_context()
        io = imgui.get_io()
        io.set_ini_filename("")
        io.display_size = imgui.ImVec2(*self.size)
        io.backend_flags |= imgui.BackendFlags_.renderer_has_textures
        self.text_font = self.figure_font = io.fonts.add_font_default()

    def show_picture(self, *_: object, **__: object) -> Any:
        return self.plain.ImTextureRef(1)

    @contextmanager
    def panel(self, title: str, width: float, height: float) -> Iterator[None]:
        """A frame with one panel of this size at the upper left corner."""
        imgui = self.plain
        imgui.get_io().delta_time = 0.5
        imgui.new_frame()
        imgui.set_next_window_pos(imgui.ImVec2(0, 0))
        imgui.set_next_window_size(imgui.ImVec2(width, height))
        imgui.begin(title)
        try:
            yield
        finally:
            imgui.end()
            imgui.render()

    def press(
        self, label: str, draw: Callable[[], None], width: float = 420.0, height: float = 780.0
    ) -> None:
        """Click the button with these letters on it, in the panel that ``draw`` lays out."""

        def turn() -> None:
            self.noted.clear()
            with self.panel("pressed", width, height):
                draw()

        turn()
        place = next(n.middle for n in self.noted if n.what == "control" and n.label.startswith(label))
        io = self.plain.get_io()
        for down in (None, True, False, None):
            io.add_mouse_pos_event(*place)
            if down is not None:
                io.add_mouse_button_event(0, down)
            turn()

    def close(self) -> None:
        self.implot.destroy_context()
        self.plain.destroy_context()
