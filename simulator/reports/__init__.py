"""Components of HTML reports: skeleton and style, tables, figures, plots. Independent of any report's subject."""
