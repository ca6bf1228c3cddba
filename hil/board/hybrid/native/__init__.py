"""The estimator's inner loops in C: kernels.h declares them, interface.py reads the types, library.py loads them.

The C lies by subject: raster/, photometric/, images/. Nothing here knows of proposals or decisions
(docs/hybrid.md, Kernels).
"""
