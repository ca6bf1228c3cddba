"""Training of networks that estimate poses; PyTorch (the extra `train`) is imported only where weights are fitted."""
