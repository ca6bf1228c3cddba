"""Our images beside images of others: statistics, our most similar view, the page."""
