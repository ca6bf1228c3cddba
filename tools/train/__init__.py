"""Training of the weights that the estimator ships with; nothing here is in the wheel."""
