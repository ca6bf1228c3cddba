"""Programs beside the window: a data set being captured, a board and the host's side of its link; no window."""
