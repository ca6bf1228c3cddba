"""Makes the pages and pictures of docs/ that are made with the software itself."""
