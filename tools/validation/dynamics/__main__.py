"""Write docs/validation/dynamics.md: ``python -m tools.validation.dynamics``."""

import sys

from tools.validation.dynamics.report import main

if __name__ == "__main__":
    sys.exit(main())
