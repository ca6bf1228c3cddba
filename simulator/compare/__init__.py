"""Our pictures beside pictures of others: statistics, the most similar view of ours, the page."""
