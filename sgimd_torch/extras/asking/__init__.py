"""Learners that ask teachers for demonstrations: SGIM-IM and SGIM-ACTS."""
