"""Capture every recipe and read it back: ``python -m tools.validation.captures``."""

import sys

from tools.validation.captures.run import main

if __name__ == "__main__":
    sys.exit(main())
