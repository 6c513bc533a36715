"""Inverse models, which infer a movement for a goal (section 4.4.2, eqs. 8 and 9)."""
