"""Selection between refined hypotheses, checks of symmetries and near minima, confidence and the acceptance test."""
