"""Movements of a run that were measured wrongly are taken back."""

WORDS = "command  command  forget"
