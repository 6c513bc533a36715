"""The forward model (not in the paper): networks that predict where a movement lands. Needs torch."""
