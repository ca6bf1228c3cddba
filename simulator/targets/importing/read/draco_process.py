"""Subprocess that decodes Draco streams: native code on untrusted bytes, with bounded memory.

Its argument is the size limit of the result [bytes]. It reads streams from standard input, each after its length
(uint64, little-endian), and writes to standard output a .npz archive: ``faces_K`` (F, 3) and ``K_ID`` (V, width) for
each attribute ID of stream K.
"""

from __future__ import annotations

import io
import sys

import numpy as np

from flyaround.simulator.targets.importing.read.bounded_process import bound_memory, finish

MAX_MEMORY_BYTES = 1 << 30  # address space of the process; a stream of a few bytes may request any size


def main(max_bytes: int) -> int:
    """Decode standard input; return 0, or 1 with the reason on standard error.

    Parameters
    ----------
    max_bytes : int
        Limit on the total size of all arrays.
    """
    try:
        import DracoPy  # noqa: PLC0415 - before memory is limited
    except ImportError as error:
        return finish(f"the decoder is missing ({error}); pip install DracoPy")
    bound_memory(MAX_MEMORY_BYTES)
    data = sys.stdin.buffer.read()
    arrays: dict[str, np.ndarray] = {}
    offset = stream = size = 0
    while offset < len(data):
        length = int.from_bytes(data[offset : offset + 8], "little")
        try:
            mesh = DracoPy.decode(data[offset + 8 : offset + 8 + length])
            stream_arrays = {f"faces_{stream}": mesh.faces}
            stream_arrays |= {f"{stream}_{int(a['unique_id'])}": a["data"] for a in mesh.attributes}
        except MemoryError:
            return finish("it unpacks to more than is read")
        except Exception as error:  # noqa: BLE001 - the decoder raises its own types
            return finish(f"a stream is damaged ({error})")
        size += sum(a.nbytes for a in stream_arrays.values())
        if size > max_bytes:
            return finish("it unpacks to more than is read")
        arrays |= stream_arrays
        offset += 8 + length
        stream += 1
    archive = io.BytesIO()
    np.savez(archive, **arrays)  # type: ignore[arg-type]
    sys.stdout.buffer.write(archive.getbuffer())
    return finish(None)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1])))
