"""Questions to a run: a movement for each goal."""

WORDS = "command  command  ask"
