"""Searches: movements from an estimate towards a goal, one by one (section 4.4.2)."""
