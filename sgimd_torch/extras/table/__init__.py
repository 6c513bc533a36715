"""Tables of results, with statistics over seeds."""

WORDS = "command  command  table"
