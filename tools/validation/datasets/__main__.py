"""Render images of every recipe and test their labels: ``python -m tools.validation.datasets``."""

import sys

from tools.validation.datasets.report import main

if __name__ == "__main__":
    sys.exit(main())
