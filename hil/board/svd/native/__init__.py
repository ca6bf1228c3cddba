"""Optional C for the estimator's inner loops: what they compute, numpy computes too (docs/svd.md, Kernels)."""
