"""Stream channel: image packets paced over time, kept for a while, and resent on request."""

from __future__ import annotations

import random
import socket
from collections import OrderedDict
from typing import TYPE_CHECKING

from flyaround.hil.host.camera_endpoint.gvsp import RESENT, packet_for_size, unavailable
from flyaround.hil.host.camera_endpoint.interface import MTU_DISCOVER, MTU_DO, MTU_DONT

if TYPE_CHECKING:
    from flyaround.hil.host.camera_endpoint.gvcp import ResendRequest
    from flyaround.hil.host.camera_endpoint.gvsp import Block

BURST = 8
"""Packets sent at once; bursts are spaced by the same number of packet intervals. Eight packets of 1500 bytes occupy a
line of 1 Gbit/s for 0.1 ms."""

MAX_BURSTS = 4
"""Largest number of consecutive bursts for catching up, before commands are processed again."""

MAX_GAP_S = 1e-4
"""Maximum time between packets [s], so that small images do not take half an interval."""

SHARE_OF_INTERVAL = 0.5
"""Share of the frame interval over which the packets of a block are spread; the rest is for resent packets."""

MAX_STORED_BYTES = 64 << 20
"""Maximum size of the images kept for resending [bytes], to bound the memory. The newest image is always kept."""

MAX_STORED_BLOCKS = 8
"""Maximum number of images kept for resending. Receivers ask for packets of the newest few."""

MAX_RESENT = 2048
"""Largest number of packets resent per request, so that one request does not keep commands waiting. An image of
1920 x 1200 pixels in packets of 1500 bytes has 1574."""

RESENT_PER_PACKET = 2
"""Limit, relative to a block's packets, of its resent packets and of the allowance that is left when it starts. A
receiver may lose a resent packet too, and ask once more."""


class StreamChannel:
    """Stream of blocks to one receiver.

    Parameters
    ----------
    sock : socket
        Socket to send from.
    loss_share : float, optional
        Share of packets that are dropped, to test a receiver's resend requests.
    seed : int, optional
        Seed of the random drops.
    """

    def __init__(self, sock: socket.socket, loss_share: float = 0.0, seed: int = 0) -> None:
        self._socket = sock
        # a full queue delays commands by no more than this
        self._socket.settimeout(0.05)
        # room for an image of 1920 x 1200 pixels of 12 bits
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4 << 20)
        self._loss_share, self._random = loss_share, random.Random(seed)
        self._sent_blocks: OrderedDict[int, Block] = OrderedDict()
        self._block: Block | None = None
        self._waiting: tuple[Block, tuple[str, int], float] | None = None
        self._number = 0
        self._due_s = self._gap_s = 0.0
        self._to: tuple[str, int] | None = None
        self._resent: dict[int, int] = {}
        self._allowance = 0
        """Number of packets that may be resent: one for each packet sent, so that requests cannot multiply the traffic;
        what is left of it when a block starts is limited by `RESENT_PER_PACKET`."""
        self.packets_sent = self.packets_resent = self.packets_dropped = 0

    @property
    def source_port(self) -> int:
        """UDP source port of the packets."""
        return int(self._socket.getsockname()[1])

    @property
    def due_s(self) -> float | None:
        """Monotonic time at which the next packets are due; None if there are none."""
        return None if self._block is None else self._due_s

    @property
    def has_room(self) -> bool:
        """True if `start` may be called: one block may wait behind the current one."""
        return self._waiting is None

    def start(
        self, block: Block, receiver: tuple[str, int], now_s: float, *, interval_s: float, delay_s: float
    ) -> None:
        """Send a block after the current one.

        Parameters
        ----------
        block : Block
            Image to send.
        receiver : tuple of str and int
            Address and port of the receiver.
        now_s : float
            Monotonic time [s].
        interval_s : float
            Frame interval [s]. The packets are spread over `SHARE_OF_INTERVAL` of it, at most `MAX_GAP_S` apart.
        delay_s : float
            Minimum time between packets [s]; it takes precedence.

        Raises
        ------
        RuntimeError
            If a block is waiting already, which would be lost; see `has_room`.
        """
        if not self.has_room:
            raise RuntimeError("a block is waiting already; check has_room before start")
        gap_s = max(delay_s, min(SHARE_OF_INTERVAL * interval_s / block.n_packets, MAX_GAP_S))
        if self._block is not None:
            self._waiting = (block, receiver, gap_s)
            return
        self._begin(block, receiver, gap_s, now_s)

    def _begin(self, block: Block, to: tuple[str, int], gap_s: float, now_s: float) -> None:
        self._block, self._number, self._to = block, 0, to
        self._gap_s, self._due_s = gap_s, now_s
        self._sent_blocks[block.block_id] = block
        while len(self._sent_blocks) > 1 and (
            len(self._sent_blocks) > MAX_STORED_BLOCKS
            or sum(len(b.data) for b in self._sent_blocks.values()) > MAX_STORED_BYTES
        ):
            self._sent_blocks.popitem(last=False)
        self._resent = {block_id: n for block_id, n in self._resent.items() if block_id in self._sent_blocks}
        self._allowance = min(self._allowance, RESENT_PER_PACKET * block.n_packets)

    def stop(self) -> None:
        """Stop sending, and forget what may be resent: the next acquisition numbers its blocks from the start."""
        self._block = self._waiting = self._to = None
        self._sent_blocks.clear()
        self._resent.clear()
        self._allowance = 0

    def step(self, now_s: float) -> None:
        """Send the packets that are due."""
        for _ in range(MAX_BURSTS):
            block, to = self._block, self._to
            if block is None or to is None or self._due_s > now_s:
                return
            end = min(self._number + BURST, block.n_packets)
            for number in range(self._number, end):
                self._send(block.packet(number), to)
            self._allowance += end - self._number
            self._number = end
            self._due_s += BURST * self._gap_s
            if end == block.n_packets:
                self._block = None
                if self._waiting is not None:
                    (block, to, gap_s), self._waiting = self._waiting, None
                    self._begin(block, to, gap_s, now_s)

    def resend(self, request: ResendRequest) -> None:
        """Resend packets that a receiver requests, or report that they are not available.

        Limited by `RESENT_PER_PACKET`, so that small requests cannot cause large traffic.
        """
        to = self._to
        if to is None or request.channel != 0:
            return
        block = self._sent_blocks.get(request.block_id)
        if block is None:
            self._send(unavailable(request.block_id, request.first), to)
            return
        last = min(request.last, block.n_packets - 1, request.first + MAX_RESENT - 1)
        if block is self._block:  # packets not yet sent are still to come
            last = min(last, self._number - 1)
        resent = self._resent.get(request.block_id, 0)
        budget = min(RESENT_PER_PACKET * block.n_packets - resent, self._allowance)
        for number in range(request.first, min(last, request.first + budget - 1) + 1):
            self.packets_resent += self._send(block.packet(number, RESENT), to)
            self._allowance -= 1
            self._resent[request.block_id] = self._resent.get(request.block_id, 0) + 1

    def send_test_packet(self, to: tuple[str, int], packet_bytes: int) -> None:
        """Send one packet of a size, without fragmentation or not at all."""
        self.set_fragments(allowed=False)
        self._send(packet_for_size(packet_bytes), to)

    def set_fragments(self, *, allowed: bool) -> None:
        """Allow or forbid the fragmentation of packets too long for the line."""
        self._socket.setsockopt(socket.IPPROTO_IP, MTU_DISCOVER, MTU_DONT if allowed else MTU_DO)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _send(self, packet: bytes, to: tuple[str, int]) -> bool:
        """Send a packet; return False if it was dropped."""
        if self._loss_share and self._random.random() < self._loss_share:
            self.packets_dropped += 1
            return False
        try:
            self._socket.sendto(packet, to)
        except OSError:
            # too long for the line, no route, or a full queue: the receiver sees a lost packet
            self.packets_dropped += 1
            return False
        self.packets_sent += 1
        return True
