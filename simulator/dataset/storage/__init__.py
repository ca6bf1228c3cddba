"""Storage of a data set: a folder or an object store, in batches that survive a loss of power, with hashes."""
