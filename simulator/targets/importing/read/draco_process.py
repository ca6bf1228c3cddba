"""Subprocess that decodes Draco streams: native code on untrusted bytes, with bounded memory.

Its argument is the most bytes that a result may have. It reads streams from standard input, each after its length
(uint64, little-endian), and writes to standard output a .npz archive: ``faces_K`` (F, 3) and ``K_ID`` (V, width) for
each attribute ID of stream K.
"""

from __future__ import annotations

import io
import sys

import numpy as np

from flyaround.simulator.targets.importing.read.bounded_process import bound_memory, finish

MAX_MEMORY_BYTES = 1 << 30


def main(most_bytes: int) -> int:
    """Decode standard input. Return 0, or 1 with the reason on standard error.

    Parameters
    ----------
    most_bytes : of all arrays together.
    """
    try:
        import DracoPy  # noqa: PLC0415 - before memory is bounded
    except ImportError as error:
        return finish(f"the decoder is missing ({error}); pip install DracoPy")
    bound_memory(MAX_MEMORY_BYTES)
    data = sys.stdin.buffer.read()
    arrays: dict[str, np.ndarray] = {}
    at = stream = size = 0
    while at < len(data):
        length = int.from_bytes(data[at : at + 8], "little")
        try:
            mesh = DracoPy.decode(data[at + 8 : at + 8 + length])
            found = {f"faces_{stream}": mesh.faces}
            found |= {f"{stream}_{int(a['unique_id'])}": a["data"] for a in mesh.attributes}
        except MemoryError:
            return finish("it unpacks to more than is read")
        except Exception as error:  # noqa: BLE001 - the decoder raises kinds of its own
            return finish(f"a stream is damaged ({error})")
        size += sum(a.nbytes for a in found.values())
        if size > most_bytes:
            return finish("it unpacks to more than is read")
        arrays |= found
        at += 8 + length
        stream += 1
    packed = io.BytesIO()
    np.savez(packed, **arrays)  # type: ignore[arg-type]
    sys.stdout.buffer.write(packed.getbuffer())
    return finish(None)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1])))
