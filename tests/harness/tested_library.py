"""A plug-in of pytest that has the tests use the library that ``FLYAROUND_TESTED_LIBRARY`` names."""

import hashlib
import os
from pathlib import Path

from flyaround.hil.board.hybrid.native import library

_MADE = Path(os.environ["FLYAROUND_TESTED_LIBRARY"])

library.library_folder = lambda: _MADE.parent
library._checksums = lambda: {_MADE.name: hashlib.sha256(_MADE.read_bytes()).hexdigest()}
library.choose_library = lambda: _MADE.name
