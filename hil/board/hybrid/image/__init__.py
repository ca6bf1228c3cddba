"""Measurements on one image: noise, gradients, edges, line segments. Independent of target and pose."""
