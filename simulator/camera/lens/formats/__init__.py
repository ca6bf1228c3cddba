"""Camera files: one module for each family of formats, each strict about its keys, and the registry of them."""
