"""Makes docs/targets.md and its pictures again: `python -m tools.docs.targets`."""

import sys
from pathlib import Path

from flyaround.__main__ import run

if __name__ == "__main__":
    sys.exit(run(["targets", "--docs", str(Path(__file__).parents[2] / "docs")]))
