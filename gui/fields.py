"""Fields for typed values, which keep a refused text with its reason until it is mended."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.text_widgets import TextWidgets

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from flyaround.gui.command_table import Argument
    from flyaround.gui.surface import Surface


class Fields(TextWidgets):
    """Fields of the current panel.

    Parameters
    ----------
    window : Surface
        Surface with the fonts and scale.
    """

    def __init__(self, window: Surface) -> None:
        super().__init__(window)
        self._refused: dict[object, tuple[str, str, object]] = {}
        """Typed texts that were refused, the reasons, and the values at that time, by field and owner."""
        self._taken = -2
        """Number of the last frame in which a field's text was taken."""
        self._good: dict[str, str] = {}
        """Last right text of each field, by its key; of one that follows a value, the text while it takes input."""
        self._drawn: dict[object, int] = {}
        """Number of the last frame in which a field was drawn."""

    def heads(self, names: Sequence[str]) -> None:
        """Draw the names of fields that follow in as many columns."""
        for name, _ in zip(names, self.grid(len(names), 1e6, len(names)), strict=True):
            self.one_line(name, style.QUIET)

    def field(self, text: str, tip: str, share: float, rgba: style.Rgba = style.INK) -> None:
        """Draw the name of the next control, which gets at most this share of the line, at its end."""
        imgui = self.imgui
        width = min(16 * share * imgui.get_font_size(), share * self.width)
        end = imgui.get_cursor_pos_x() + self.width
        imgui.align_text_to_frame_padding()
        self.cut_line(text, self.width - width - 8, rgba, tip)
        imgui.same_line(end - width)
        imgui.set_next_item_width(width)

    def typed(self, key: str, text: str, argument: Argument, title: str, follows: str = "") -> str:
        """Draw a field for an argument's value, which says what is wrong with its text.

        Parameters
        ----------
        key : str
            Identifier within the panel.
        text : str
            Typed text.
        argument : Argument
            The argument.
        title : str
            Name of the group of fields, for refusals.
        follows : str, optional
            Value that the field shows, dimmed, while its text is empty: before any input, and after Esc.

        Returns
        -------
        str
            The text; empty if the field follows a value.
        """
        shown = text or self._good.get(key, "") or follows if follows else text
        with self.coloured(style.QUIET if follows and not text else style.INK):
            new = self._number(key, shown)
        text = new if text or new != shown else ""
        given_up, escaped = self._given_up(key), self.imgui.is_item_deactivated()
        if given_up and ((escaped and follows) or argument.flaw(text or follows, title)):
            text = "" if follows else self._good.get(key, "")
        self.flaw(flaw := argument.flaw(text or follows, title))
        if follows:
            # a value that changes under the cursor is no input
            self._good[key] = shown if self.imgui.is_item_active() else ""
        elif not flaw:
            self._good[key] = text
        self.tip(flaw or argument.description + "; dim: it follows, Esc lets it follow again" * bool(follows))
        return text

    def _number(self, key: str, text: str) -> str:
        """Draw a text field, in which a double click selects everything; return its text."""
        imgui = self.imgui
        text = str(imgui.input_text(f"##{key}", text)[1])
        if imgui.is_item_active() and imgui.is_mouse_double_clicked(0):
            # Dear ImGui selects a word, which of -0.02 are its last digits
            imgui.internal.get_input_text_state(imgui.get_item_id()).select_all()
        return text

    def entry(
        self,
        key: str,
        shown: str,
        take: Callable[[str], str],
        tip: str,
        of: object = None,
        now: object = None,
    ) -> None:
        """Draw a field for a value that Enter, or leaving the field, hands to ``take``.

        What ``take`` refuses stays in the field until it is mended, Esc brings the value back, the value changes by
        other means, or the panel is hidden.

        Parameters
        ----------
        key : str
            Identifier within the panel.
        shown : str
            Present value.
        take : callable
            Function that takes a text and returns why it refuses it, or an empty text.
        tip : str
            Hover text.
        of : object, optional
            Owner of the value, if the field may become another one's.
        now : object, optional
            Values that are changed together, by default the present one.
        """
        imgui, field, now = self.imgui, (key, of), now or shown
        text, flaw, then = self._refused.get(field, (shown, "", now))
        if then != now and self._taken < imgui.get_frame_count() - 1:
            # neither this field nor one beside it changed the value
            text, flaw = shown, ""
        text = self._number(key, text)
        ended = imgui.is_item_deactivated_after_edit() and not imgui.is_key_pressed(imgui.Key.escape)
        if self._given_up(field) or ended:
            flaw = take(text) if ended else ""
            self._taken = imgui.get_frame_count() if ended and not flaw else self._taken
        if flaw:
            self._refused[field] = text, flaw, now
        else:
            self._refused.pop(field, None)
        self.flaw(flaw)
        self.tip(flaw or f"{tip}; Enter applies it, Esc discards it")

    def _given_up(self, key: object) -> bool:
        """Return True on Esc, and if the field was out of sight since it was last drawn."""
        now = self.imgui.get_frame_count()
        before, self._drawn[key] = self._drawn.get(key, now), now
        return now > before + 1 or self.imgui.is_key_pressed(self.imgui.Key.escape)

    def flaw(self, text: str) -> None:
        """Frame the last item, and say in the message line what is wrong with its value; unless empty."""
        if text and self.imgui.is_item_visible():
            low, high = self.imgui.get_item_rect_min(), self.imgui.get_item_rect_max()
            self.frame(style.BAD, (low.x, low.y, high.x, high.y))
            # of several, that of the field that takes text
            if self.imgui.is_item_active() or not self.window.flaw:
                self.window.flaw = text
