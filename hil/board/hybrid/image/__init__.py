"""What one image alone says: noise, gradients, edges, line segments. Knows no target and no pose."""
