"""Hand-written bugs of physics, labels and messages; each is planted in a copy of the tree and tested there."""
