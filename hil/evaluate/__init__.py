"""Any estimator against labelled frames: errors and metrics."""
