"""Debug pictures of each stage's results; estimation does not need them."""
