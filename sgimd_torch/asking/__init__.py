"""Learners that ask teachers for demonstrations: SGIM-IM, SGIM-ACTS, and a rival that compares entropies."""
