"""From a command line to the settings of a run: names of parts, and their options."""
