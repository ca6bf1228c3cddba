"""Inner loops of the estimator in C, with their Python binding; see docs/hybrid.md, Kernels.

``kernels.h`` declares the functions, ``interface.py`` derives their argument types from it, and ``library.py`` loads
the library. The sources are in ``raster/``, ``photometric/`` and ``images/``.
"""
