"""NumPy reference of the compiled library, for its tests."""
