"""Files dragged onto a window as a file manager does: the source's side of XDND 5, over a small X client."""

from __future__ import annotations

import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

VERSION = 5
WAIT_S = 60.0


class DragSource:
    """A client that owns what is dragged, and answers for it until the window has taken it.

    Parameters
    ----------
    display : name of the X server. window : number of the window that files are dropped on.
    """

    def __init__(self, display: str, window: int) -> None:
        xlib = pytest.importorskip("Xlib.display", reason="pip install 'flyaround[console-test]'")
        from Xlib import X
        from Xlib.protocol import event

        self._x, self._events = X, event
        self._display = xlib.Display(display)
        root = self._display.screen().root
        self._window = self._display.create_resource_object("window", window)
        self._source = root.create_window(0, 0, 1, 1, 0, X.CopyFromParent)
        self._atom = self._display.intern_atom

    def drop(self, paths: Iterable[Path], at: tuple[int, int]) -> bool:
        """Enter, move to a place of the screen, let go; whether the window says that it took the files."""
        self._files = "".join(f"{p.resolve().as_uri()}\r\n" for p in paths).encode()
        selection, uris = self._atom("XdndSelection"), self._atom("text/uri-list")
        self._source.set_selection_owner(selection, self._x.CurrentTime)
        self._send("XdndEnter", VERSION << 24, uris, 0, 0)
        place = at[0] << 16 | at[1]
        self._send("XdndPosition", 0, place, self._x.CurrentTime, self._atom("XdndActionCopy"))
        status = self._wait("XdndStatus")
        if not status[1] & 1:
            self._send("XdndLeave", 0, 0, 0, 0)
            return False
        self._send("XdndDrop", 0, self._x.CurrentTime, 0, 0)
        # GLFW answers with how many bytes it took, not with the first bit alone
        return bool(self._wait("XdndFinished")[1])

    def _send(self, kind: str, *numbers: int) -> None:
        message = self._events.ClientMessage(
            window=self._window, client_type=self._atom(kind), data=(32, [self._source.id, *numbers])
        )
        self._window.send_event(message)
        self._display.flush()

    def _wait(self, kind: str) -> Any:
        """The numbers of the window's answer; what it asks for meanwhile is given."""
        wanted, until = self._atom(kind), time.monotonic() + WAIT_S
        while time.monotonic() < until:
            if not self._display.pending_events():
                time.sleep(0.01)
                continue
            came = self._display.next_event()
            if came.type == self._x.SelectionRequest:
                self._give(came)
            elif came.type == self._x.ClientMessage and came.client_type == wanted:
                return came.data[1]
        pytest.fail(f"the window never answered {kind}")

    def _give(self, request: Any) -> None:
        request.requestor.change_property(request.property, request.target, 8, self._files)
        told = self._events.SelectionNotify(
            time=request.time,
            requestor=request.requestor,
            selection=request.selection,
            target=request.target,
            property=request.property,
        )
        request.requestor.send_event(told)
        self._display.flush()

    def close(self) -> None:
        self._display.close()
