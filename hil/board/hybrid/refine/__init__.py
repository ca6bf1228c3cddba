"""Refiners: a hypothesis moved to where the image wants it, by edges or by all its pixels. Accepts nothing."""
