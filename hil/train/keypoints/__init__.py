"""Training of the keypoint network: renders views, derives samples, fits trunk and heads, and writes their files."""
