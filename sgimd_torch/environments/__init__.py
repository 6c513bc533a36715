"""Environments: their protocol, planar arms, and the fishing rod of section 4 in MuJoCo."""
