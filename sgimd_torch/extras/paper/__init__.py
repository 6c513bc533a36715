"""The paper's figures, made anew."""

WORDS = "command  command  paper"
NEEDS = ("pictures", "report", "sweep", "table")
INSTALL = "report"
