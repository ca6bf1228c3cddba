"""Packets that are sent again: those that were missed, and no flood."""

import socket

import numpy as np
import pytest

from flyaround.hil.host.camera_endpoint.gvcp import ResendRequest
from flyaround.hil.host.camera_endpoint.gvsp import Block, ReadoutRegion, StreamFormat
from flyaround.hil.host.camera_endpoint.stream_channel import RESENT_PER_PACKET, StreamChannel

SIZE = 128


@pytest.fixture
def channel():
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        receiver.bind(("127.0.0.1", 0))
        made = StreamChannel(sender)
        made.to = receiver.getsockname()
        yield made


def image(block_id):
    return Block(
        block_id=block_id,
        timestamp_ns=0,
        pixel_format=StreamFormat.Mono8,
        region=ReadoutRegion(x=0, y=0, width=SIZE, height=SIZE),
        data=np.zeros((SIZE, SIZE), np.uint8).tobytes(),
        packet_bytes=576,
    )


def send(channel, block_id):
    """Send one block whole; how many packets it has."""
    block = image(block_id)
    channel.start(block, channel.to, 0.0, interval_s=0.03, delay_s=0.0)
    while channel.due_s is not None:
        channel.step(channel.due_s)
    return block.n_packets


def ask(channel, block_id, first, last):
    channel.resend(ResendRequest(channel=0, block_id=block_id, first=first, last=last))


def test_missed_packets_come_again(channel):
    n = send(channel, 1)
    ask(channel, 1, 3, 7)
    ask(channel, 1, 3, 3)
    assert (channel.packets_resent, channel.packets_sent) == (6, n + 6)


def test_requests_without_end_bring_no_more_than_the_stream_itself(channel):
    sent = 0
    for block_id in range(1, 6):
        n = send(channel, block_id)
        sent += n
        before = channel.packets_resent
        for _ in range(100):
            ask(channel, block_id, 0, n)
        assert channel.packets_resent - before <= RESENT_PER_PACKET * n
    for _ in range(1000):
        for block_id in range(1, 6):
            ask(channel, block_id, 0, n)
    assert channel.packets_resent <= sent


def test_every_acquisition_has_its_own_allowance(channel):
    for _ in range(3):
        n = send(channel, 1)
        before = channel.packets_resent
        ask(channel, 1, 0, n)
        assert channel.packets_resent - before == n
        channel.stop()
    send(channel, 1)
    channel.stop()
    n = send(channel, 1)
    before = channel.packets_resent
    for _ in range(3):
        ask(channel, 1, 0, n)
    assert channel.packets_resent - before == n


def test_a_waiting_block_is_not_replaced(channel):
    for block_id in (1, 2):
        channel.start(image(block_id), channel.to, 0.0, interval_s=0.03, delay_s=0.0)
    with pytest.raises(RuntimeError, match="has_room"):
        channel.start(image(3), channel.to, 0.0, interval_s=0.03, delay_s=0.0)


def test_dropped_packets_do_not_count_as_resent(channel):
    n = send(channel, 1)
    channel._loss_share = 1.0
    ask(channel, 1, 0, n)
    assert (channel.packets_resent, channel.packets_dropped) == (0, n)


def test_a_stream_that_loses_one_in_five_is_still_mended(channel):
    for block_id in range(1, 30):
        n = send(channel, block_id)
        before = channel.packets_resent
        for number in range(0, n, 5):
            ask(channel, block_id, number, number)
        assert channel.packets_resent - before == len(range(0, n, 5))
