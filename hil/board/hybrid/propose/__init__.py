"""Proposal of image regions and pose hypotheses, without refinement or decision."""
