"""Several robots that move at once."""

WORDS = "hook  hook  at-once=AtOnce"
