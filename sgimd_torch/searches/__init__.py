"""Searches: from a first guess to a goal, movement by movement (section 4.4.2)."""
