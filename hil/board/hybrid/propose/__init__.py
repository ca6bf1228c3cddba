"""Generators: from an image to regions and pose hypotheses. Refines and decides nothing."""
