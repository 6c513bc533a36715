"""Goals for evaluation, from where runs landed."""

WORDS = "command  command  benchmark"
