"""A serial line without hardware: two pseudo-terminals whose far ends are wired to each other."""

from __future__ import annotations

import os
import pty
import select
import threading
from collections.abc import Callable
from contextlib import contextmanager


@contextmanager
def null_modem(damage_every: int = 0, noise: Callable[[bytes], bytes] = bytes):
    """Two serial devices; flips a bit in every ``damage_every``-th byte from left to right, and adds noise there."""
    ends = [pty.openpty() for _ in range(2)]
    stop = threading.Event()

    def wire() -> None:
        masters, seen = [master for master, _ in ends], 0
        while not stop.is_set():
            for ready in select.select(masters, [], [], 0.05)[0]:
                data = bytearray(os.read(ready, 4096))
                if ready == masters[0] and damage_every:
                    for k in range(len(data)):
                        seen += 1
                        if seen % damage_every == 0:
                            data[k] ^= 0x20
                if ready == masters[0]:
                    data = bytearray(noise(bytes(data)))
                other = masters[1 - masters.index(ready)]
                while data:
                    del data[: os.write(other, data)]

    thread = threading.Thread(target=wire, daemon=True)
    thread.start()
    try:
        yield [os.ttyname(slave) for _, slave in ends]
    finally:
        stop.set()
        thread.join(2.0)
        for end in ends:
            for fd in end:
                os.close(fd)
