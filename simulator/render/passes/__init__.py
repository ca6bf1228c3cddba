"""One file per pass; each declares what it reads and what it writes."""
