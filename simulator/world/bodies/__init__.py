"""The built-in bodies, one per file, found by name (`world.ephemeris.body.body_named`). No drawing, no forces."""
