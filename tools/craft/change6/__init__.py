"""Ascent vehicle of Chang'e-6."""
