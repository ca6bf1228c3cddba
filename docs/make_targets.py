"""Makes docs/targets.md and its pictures again: `python docs/make_targets.py`."""

import sys
from pathlib import Path

from flyaround.__main__ import run

if __name__ == "__main__":
    sys.exit(run(["targets", "--docs", str(Path(__file__).parent)]))
