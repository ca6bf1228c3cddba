"""Byte errors at one in a hundred thousand to one in a thousand: the decoders in C and Python accept nothing wrong.

On a serial line every packet that no error struck comes whole, whatever became of the one before it: the receiver is in
step again at the next delimiter. In C also from a device, while our host sends.
"""

import random
import subprocess
import threading
from pathlib import Path

import numpy as np
import pytest
from c_program import compiled
from cobs import cobs as reference
from serial_line import null_modem

from flyaround.hil.link.errors import PacketError
from flyaround.hil.link.framing.cobs import CobsFraming
from flyaround.hil.link.framing.length_prefix import LengthFraming
from flyaround.hil.link.packets.messages import Bye
from flyaround.hil.link.packets.packet import Packet, PacketType, decode_packet, encode_packet
from flyaround.hil.link.transports.serial_port import SerialTransport

RATES = [1e-5, 1e-4, 1e-3]
PATIENCE_S = 60.0


class Noise:
    """Byte errors of a line: flipped, inserted and deleted at random from a seed.

    Parameters
    ----------
    rate : errors in a byte, a third of each kind.
    """

    def __init__(self, rate, seed):
        self._rate, self._rng = rate, np.random.default_rng(seed)
        self._passed = 0
        self.places: list[int] = []

    def __call__(self, data):
        """The next bytes, with their errors."""
        places = np.nonzero(self._rng.random(len(data)) < self._rate)[0].tolist()
        parts, at = [], 0
        for place in places:
            kind, value = self._rng.integers(0, 3), int(self._rng.integers(1, 256))
            parts.append(data[at:place])
            if kind == 0:
                parts.append(bytes([data[place] ^ value]))
            elif kind == 1:  # a quarter of those inserted are delimiters
                parts.append(bytes([value if value % 4 else 0, data[place]]))
            at = place + 1
        parts.append(data[at:])
        self.places += [self._passed + place for place in places]
        self._passed += len(data)
        return b"".join(parts)

    def untouched(self, sizes):
        """Which of the packets, that followed each other with these sizes, no error struck."""
        struck = np.searchsorted(np.cumsum(sizes), self.places, side="right")
        return set(range(len(sizes))) - set(struck.tolist())


def packets(count, seed):
    """Chunks as a serial line has them and short packets, some full of zeros; no two alike."""
    rng = random.Random(seed)
    for k in range(count):
        size = rng.choice([0, 8, 253, 254, 255, 508, 2064])
        data = rng.randbytes(size) if k % 3 else bytes(size)
        yield Packet(PacketType.FRAME_CHUNK, data, 5, k)


@pytest.fixture(scope="module")
def c_decoder(tmp_path_factory):
    return str(compiled(Path(__file__).with_name("test_link_c_stream.c"), tmp_path_factory.mktemp("c")))


def read_lines(said):
    """Packets that the C program accepted, and how many it refused."""
    got, refused = [], 0
    for line in said.decode().splitlines():
        status, _, stuffed = line.partition(" ")
        if int(status):
            refused += 1
            continue
        data = bytes.fromhex(stuffed)
        got.append(decode_packet(reference.decode(data)))
        assert data == reference.encode(encode_packet(got[-1]))
    return got, refused


def read_python(framing, stream):
    """The same of a framing of ours, whose bytes come in pieces."""
    got, refused = [], 0
    for at in range(0, len(stream), 4096):
        framing.feed(stream[at : at + 4096])
        while True:
            try:
                packet = framing.next_packet()
            except PacketError:
                refused += 1
                continue
            if packet is None:
                break
            got.append(packet)
    return got, refused


def strike(c_decoder, rate, seed, count):
    sent, framing = list(packets(count, seed)), CobsFraming()
    parts = [framing.encode(one) for one in sent]
    noise = Noise(rate, seed)
    stream = noise(b"".join(parts))
    done = subprocess.run([c_decoder], input=stream, capture_output=True, check=True, timeout=PATIENCE_S)
    in_c = read_lines(done.stdout)
    assert in_c == read_python(CobsFraming(), stream) == read_python(CobsFraming(pure=True), stream)
    got, refused = in_c
    numbers = [one.sequence for one in got]
    whole = noise.untouched([len(part) for part in parts])
    assert all(one == sent[one.sequence] for one in got)
    assert numbers == sorted(set(numbers))
    assert whole <= set(numbers)
    assert refused > 0 or len(got) == count
    # on a network's stream the length of a damaged packet may be what is wrong; what it covers is looked through
    prefixed = [LengthFraming().encode(one) for one in sent]
    noise = Noise(rate, seed)
    got, _ = read_python(LengthFraming(), noise(b"".join(prefixed)))
    assert all(one == sent[one.sequence] for one in got)
    whole = noise.untouched([len(part) for part in prefixed])
    # a packet whose neighbour was struck may have lost its prefix to it
    assert len(whole - {one.sequence for one in got}) <= len(noise.places)
    return len(numbers) / count


@pytest.mark.parametrize("rate", RATES)
def test_no_false_accept_and_in_step_at_the_next_delimiter(c_decoder, rate):
    share = strike(c_decoder, rate, 11, 400)
    assert share > (1 - rate) ** 800 - 0.06


@pytest.mark.parametrize("rate", [0.0, *RATES])
def test_the_decoder_in_c_reads_a_device_while_the_host_sends(c_decoder, rate):
    sent = list(packets(120, 3))
    framing = CobsFraming()
    sizes = [len(framing.encode(one)) for one in sent]
    noise = Noise(rate, 7)
    with (
        null_modem(noise=noise) as (left, right),
        subprocess.Popen([c_decoder, right], stdout=subprocess.PIPE) as reader,
    ):
        assert reader.stdout.readline() == b"ready\n"
        host, heard = SerialTransport(left, 12_000_000), []
        thread = threading.Thread(target=lambda: heard.append(reader.stdout.read()))
        thread.start()
        for one in sent:
            host.send_packet(one)
        while thread.is_alive():  # whatever becomes of the first goodbyes
            host.send_packet(Packet(PacketType.BYE, Bye("over").encode(), 5, 999))
            thread.join(0.05)
        host.close()
    got, refused = read_lines(heard[0])
    assert got.pop().type is PacketType.BYE
    assert all(one == sent[one.sequence] for one in got)
    assert noise.untouched(sizes) <= {one.sequence for one in got}
    assert refused > 0 or len(got) == len(sent)
