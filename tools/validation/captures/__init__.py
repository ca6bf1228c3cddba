"""Captures of every recipe in every format for learning, by the command itself: checked, read back, timed."""
