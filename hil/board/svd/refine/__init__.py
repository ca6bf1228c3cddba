"""Refiners: a hypothesis moved to where the picture wants it, by edges or by all its pixels. Accepts nothing."""
