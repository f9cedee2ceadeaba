"""Pictures: figures for print, and pages that turn in a browser."""
