"""Generation of the data files of assets/ from their sources."""
