"""Engines carry out a list of runs, in processes of this machine or on a cluster; both kinds share ``loop``."""
