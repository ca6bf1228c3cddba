"""Textures, stars, scenarios, cameras: data with provenance in NOTICE.md. No Python logic lives here."""
