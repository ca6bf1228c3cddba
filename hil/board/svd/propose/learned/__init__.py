"""The learned first look: a small network that proposes attitudes and corrects a region's place and size."""
