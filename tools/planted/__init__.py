"""Bugs of physics, labels and messages, chosen by hand; each is planted in a copy of the tree and tested there."""
