"""Goal models, which choose the next goal: the interest map of section 3.2.1, and alternatives to it."""
