"""Goal models, which choose the next goal: the interest map of section 3.2.1, and what it is compared with."""
