"""Training of pose-estimation networks. PyTorch (the extra `train`) is imported only where weights are fitted."""
