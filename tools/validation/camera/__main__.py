"""Write docs/validation/camera.md: ``python -m tools.validation.camera``."""

import sys

from tools.validation.camera.report import main

if __name__ == "__main__":
    sys.exit(main())
