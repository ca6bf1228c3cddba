"""Write docs/validation/rendering.md: ``python -m tools.validation.rendering``."""

import sys

from tools.validation.rendering.report import main

if __name__ == "__main__":
    sys.exit(main())
