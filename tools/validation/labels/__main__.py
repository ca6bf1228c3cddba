"""Checks random frames, and writes docs/validation/labels.md with --page: ``python -m tools.validation.labels``."""

import sys

from tools.validation.labels.report import main

if __name__ == "__main__":
    sys.exit(main())
