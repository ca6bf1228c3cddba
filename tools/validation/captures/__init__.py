"""Captures of every recipe in every export format by the command itself: checked, read back and timed."""
