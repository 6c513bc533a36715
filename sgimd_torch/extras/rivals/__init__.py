"""Rivals: learners and parts from the literature, for comparisons."""
