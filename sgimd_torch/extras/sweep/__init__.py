"""Many runs: every combination of options with every seed, on this machine or on a cluster."""

WORDS = "command  command  sweep"
