"""The learned proposal: a small network that proposes attitudes and corrects a region's place and size."""
