"""Check random frames, and with --page write docs/validation/labels.md: ``python -m tools.validation.labels``."""

import sys

from tools.validation.labels.report import main

if __name__ == "__main__":
    sys.exit(main())
