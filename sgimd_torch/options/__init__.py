"""From a command line to a built learner: names of parts, their options, the settings of a run, its parts."""
