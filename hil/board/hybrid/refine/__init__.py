"""Refinement of hypotheses on edges or on all pixels. Accepts nothing."""
