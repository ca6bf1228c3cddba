"""Studies that the documents quote; nothing here is in the wheel."""
