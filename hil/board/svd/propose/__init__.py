"""Generators: from a picture to regions and pose hypotheses. Refines and decides nothing."""
