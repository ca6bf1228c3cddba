"""Pages of small pictures: each target from all sides, a flight at a glance. Nothing below dataset/ imports it."""
