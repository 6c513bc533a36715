"""Exploration of Pi: searches from an estimate towards a goal (section 4.4.2), and global movements (4.4.1)."""
