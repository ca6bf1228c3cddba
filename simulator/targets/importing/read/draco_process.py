"""A process of its own that decodes Draco streams: native code on untrusted bytes, with bounded memory.

Its argument is the most bytes that a result may have. It reads streams from standard input, each after its length
(uint64, little-endian), and writes to standard output a .npz archive: ``faces_K`` (F, 3) and ``K_ID`` (V, width) for
each attribute ID of stream K.
"""

from __future__ import annotations

import io
import sys

import numpy as np

MOST_MEMORY_BYTES = 1 << 30


def main(most_bytes: int) -> int:
    """Decode what stands on standard input; 0, or 1 with the reason on standard error.

    Parameters
    ----------
    most_bytes : of all arrays together.
    """
    try:
        import DracoPy  # noqa: PLC0415 - before memory is bounded
    except ImportError as error:
        print(f"the decoder is missing ({error}); pip install DracoPy", file=sys.stderr)  # noqa: T201
        return 1
    _bound_memory()
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
            print("it unpacks to more than is read", file=sys.stderr)  # noqa: T201
            return 1
        except Exception as error:  # noqa: BLE001 - the decoder raises kinds of its own
            print(f"a stream is damaged ({error})", file=sys.stderr)  # noqa: T201
            return 1
        size += sum(a.nbytes for a in found.values())
        if size > most_bytes:
            print("it unpacks to more than is read", file=sys.stderr)  # noqa: T201
            return 1
        arrays |= found
        at += 8 + length
        stream += 1
    packed = io.BytesIO()
    np.savez(packed, **arrays)  # type: ignore[arg-type]
    sys.stdout.buffer.write(packed.getbuffer())
    return 0


def _bound_memory() -> None:
    """A stream of a few bytes may ask for any size."""
    try:
        import resource  # noqa: PLC0415 - Unix alone has it
    except ImportError:
        return
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY_BYTES, MOST_MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1])))
