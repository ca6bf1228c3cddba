"""Where a data set's files go: a folder or an object store, in batches that outlast a loss of power, with hashes."""
