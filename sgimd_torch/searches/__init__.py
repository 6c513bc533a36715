"""Searches: movement by movement from a first guess towards a goal (section 4.4.2)."""
