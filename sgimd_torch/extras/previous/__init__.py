"""A robot with memory: whether outcomes depend on the movement before, and its theta as a context."""

WORDS = "hook  hook  previous=Previous"
PUBLIC = "with_previous  with_previous"
NEEDS = ("changes",)
