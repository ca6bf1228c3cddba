"""The device that refuses every write as a full disk does."""

from pathlib import Path

import pytest

FULL = Path("/dev/full")
needs_full_device = pytest.mark.skipif(not FULL.is_char_device(), reason="the system has no device /dev/full")
