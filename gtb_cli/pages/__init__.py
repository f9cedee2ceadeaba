"""Pages: HTML files in which surfaces turn in a browser, and what a notebook shows."""
