"""Pictures of T on the board: errors at goals, and the regions of the goal model."""

WORDS = "hook  hook  pictures=Pictures"
INSTALL = "board"
