"""A network between two ends of a UDP line that loses, doubles and swaps datagrams, by chance from a seed."""

from __future__ import annotations

import random
import select
import socket
import threading
from contextlib import contextmanager


@contextmanager
def lossy_network(host_port: int, *, loss=0.0, swap=0.0, double=0.0, flip=0.0, seed=0):
    """Yields the URL that a board connects to, and the counts of what was done to datagrams."""
    front = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    front.bind(("127.0.0.1", 0))
    back = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    back.connect(("127.0.0.1", host_port))
    for sock in (front, back):
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        sock.setblocking(False)
    rng, stop, counts = random.Random(seed), threading.Event(), {"sent": 0, "lost": 0, "swapped": 0}
    board = [None]
    held: dict[socket.socket, bytes] = {}

    def put(sock, data):
        try:
            if sock is back:
                sock.send(data)
            elif board[0] is not None:
                sock.sendto(data, board[0])
        except OSError:
            counts["lost"] += 1

    def carry(sock, data):
        counts["sent"] += 1
        if rng.random() < loss:
            counts["lost"] += 1
            return
        if flip and rng.random() < flip:
            k = rng.randrange(len(data))
            data = data[:k] + bytes([data[k] ^ 1 << rng.randrange(8)]) + data[k + 1 :]
        if sock not in held and rng.random() < swap:
            counts["swapped"] += 1
            held[sock] = data
            return
        put(sock, data)
        if rng.random() < double:
            put(sock, data)
        if sock in held:
            put(sock, held.pop(sock))

    def run():
        while not stop.is_set():
            ready = select.select([front, back], [], [], 0.01)[0]
            if not ready:
                for sock in list(held):
                    put(sock, held.pop(sock))
            for sock in ready:
                try:
                    data, address = sock.recvfrom(65536)
                except OSError:
                    continue
                if sock is front:
                    board[0] = address
                carry(back if sock is front else front, data)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        yield f"udp://127.0.0.1:{front.getsockname()[1]}", counts
    finally:
        stop.set()
        thread.join(2.0)
        front.close()
        back.close()
