"""A report: one page about one run, or about many runs side by side."""

WORDS = "command  command  report"
NEEDS = ("pictures", "table")
INSTALL = "report"
