"""Pictures of T on the board: errors at goals, and competence by region."""

WORDS = "hook  hook  pictures=Pictures"
INSTALL = "board"
