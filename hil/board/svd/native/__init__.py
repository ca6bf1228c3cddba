"""The estimator's inner loops in C, each behind the numpy function that it is the twin of (``backend.accelerated``).

C and the Python that calls it lie side by side by subject: raster/, photometric/, images/, learned/. Nothing here knows
of proposals, hypotheses or decisions; where no C compiler is found, numpy does all of it (docs/svd.md, Kernels).
"""
