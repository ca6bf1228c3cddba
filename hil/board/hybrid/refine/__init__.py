"""Refinement of hypotheses on edges or on all pixels; the decision to accept a pose is in ``decide``."""
