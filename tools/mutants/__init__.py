"""Mutation testing: a seeded sample of cosmic-ray's mutants, judged in a copy of the tree."""
