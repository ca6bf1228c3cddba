"""Mutation testing: a seeded sample of small plausible bugs, each planted in a copy of the tree and tested there."""
