"""Bugs of physics, labels and messages chosen by hand, each planted in a copy of the tree and tested there."""
