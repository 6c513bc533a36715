"""Teaching by hand in a browser."""
