"""The proof: comparisons with analytic results and independent programs."""
