"""Runs on disk: options, parts, run directory, log and replay."""
