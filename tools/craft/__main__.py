"""Command that writes ``assets/targets``: every built-in craft at its three levels of detail.

``python -m tools.craft`` writes all of them again, ``python -m tools.craft tango dragon`` those two.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import zstandard

from flyaround.simulator.targets.glb.write import glb_bytes
from flyaround.simulator.targets.library import SUFFIX
from flyaround.simulator.targets.model import DETAILS, Detail, level_name
from tools.craft.change6.ascender import build_change6_ascender
from tools.craft.charuco import build_calibration_board
from tools.craft.chessboard import build_chessboard
from tools.craft.cubesat.six import build_cubesat_6u
from tools.craft.cubesat.swisscube import build_cubesat_1u
from tools.craft.cubesat.triple import build_cubesat_3u
from tools.craft.dragon.cargo import build_dragon_cargo
from tools.craft.dragon.crew import build_dragon
from tools.craft.envisat.craft import build_envisat
from tools.craft.soyuz.soyuz_ms import build_soyuz_ms
from tools.craft.tango.build import build_tango, build_tango_mli, build_tango_mockup
from tools.craft.tango.thesis import build_tango_thesis
from tools.craft.tianzhou.tianzhou import build_tianzhou

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from flyaround.simulator.targets.model import Target

FOLDER = Path(__file__).parents[2] / "assets" / "targets"

BUILDERS: dict[str, Callable[[Detail], Target]] = {
    "calibration-board": build_calibration_board,
    "change6-ascender": build_change6_ascender,
    "chessboard": build_chessboard,
    "cubesat-1u": build_cubesat_1u,
    "cubesat-3u": build_cubesat_3u,
    "cubesat-6u": build_cubesat_6u,
    "dragon": build_dragon,
    "dragon-cargo": build_dragon_cargo,
    "envisat": build_envisat,
    "soyuz-ms": build_soyuz_ms,
    "tango": build_tango,
    "tango-mli": build_tango_mli,
    "tango-mockup": build_tango_mockup,
    "tango-thesis": build_tango_thesis,
    "tianzhou": build_tianzhou,
}

# higher levels of zstd do not make these files smaller
_ZSTD_LEVEL = 19


def built_files(name: str) -> Iterator[tuple[str, bytes]]:
    """Build a craft and yield the name and the target file of each level of detail."""
    for detail in DETAILS:
        level = level_name(name, detail)
        # the hash does not cover the name, so builders need not know what levels are called
        yield level, glb_bytes(replace(BUILDERS[name](detail), name=level))


def main() -> None:
    """Write the files whose contents have changed."""
    parser = argparse.ArgumentParser(prog="python -m tools.craft", description=__doc__)
    parser.add_argument("names", nargs="*", help=f"craft: {', '.join(BUILDERS)} (default: all)")
    names = parser.parse_args().names or list(BUILDERS)
    if unknown := set(names) - set(BUILDERS):
        parser.error(f"no craft has the name {', '.join(sorted(unknown))}: choose from {', '.join(BUILDERS)}")
    # the checksum detects a damaged name or mass, which the target's own hash does not cover
    compressor = zstandard.ZstdCompressor(level=_ZSTD_LEVEL, write_checksum=True)
    FOLDER.mkdir(exist_ok=True)
    for name in names:
        for level, data in built_files(name):
            path = FOLDER / (level + SUFFIX)
            if not path.is_file() or zstandard.decompress(path.read_bytes()) != data:
                path.write_bytes(compressor.compress(data))
                print(path)


if __name__ == "__main__":
    main()
