"""Robots of gymnasium as ours, and ours as gymnasium's."""

NEEDS = ("check",)
PUBLIC = """
controllers     Sinusoids
from_gymnasium  FromGymnasium measured_noise
to_gymnasium    ToGymnasium
"""
