"""Selection between refined hypotheses, checks of symmetries, confidence and the acceptance test."""
