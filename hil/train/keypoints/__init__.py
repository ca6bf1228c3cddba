"""Training of the keypoint network: views drawn, samples made of them, trunk and heads fitted, files written."""
