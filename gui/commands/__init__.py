"""The operator's commands, one file per subject; `all` lists them."""
