"""Learners of other schools, to compare with."""
