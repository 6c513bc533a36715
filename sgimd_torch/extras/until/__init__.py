"""The end of a run once its learner expects small errors."""

WORDS = "hook  hook  until=Until"
