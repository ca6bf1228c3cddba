"""Pages of small images: each target from all sides, a flight at a glance. Nothing below dataset/ imports it."""
