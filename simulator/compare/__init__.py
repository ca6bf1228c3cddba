"""Our images next to images of others: statistics, our most similar view, the page."""
