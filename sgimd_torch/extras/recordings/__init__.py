"""Recordings of other programs: their columns and units, a check on a robot, an arm that is led."""

WORDS = "command  command  demonstrations"
INSTALL = "plot"
NEEDS = ("table",)
