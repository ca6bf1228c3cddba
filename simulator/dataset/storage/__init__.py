"""Storage of a data set: a folder or an object store, in durable batches, with hashes."""
