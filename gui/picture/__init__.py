"""Pictures asked for, and what is drawn over them; no window."""
