"""A first look: three learners side by side."""

WORDS = "command  command  demo"
NEEDS = ("report", "sweep", "table")
INSTALL = "plot"
