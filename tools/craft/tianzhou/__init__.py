"""Tianzhou, the cargo craft of the Chinese space station."""
