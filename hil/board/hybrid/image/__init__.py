"""Measurements on one image: noise, gradients, edges, line segments. Knows no target and no pose."""
