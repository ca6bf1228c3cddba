"""Times what drawing costs over scenarios, cameras, pixels, triangles and processes."""
