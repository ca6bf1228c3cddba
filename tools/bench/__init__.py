"""Cost of rendering over scenarios, cameras, pixels, triangles and processes."""
