"""Proposal of regions and pose hypotheses. Refines and decides nothing."""
