"""Captures of every recipe in every learner's format by the command itself: checked, read back, timed."""
