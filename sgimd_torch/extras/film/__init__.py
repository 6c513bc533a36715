"""Films of what a run has learnt, drawn by MuJoCo or in the plane."""

WORDS = "command  command  film"
NEEDS = ("models", "pictures", "report", "table")
INSTALL = "film"
