"""One kit for HTML reports: skeleton and style, tables, figures, plots. Knows nothing of what a report is about."""
