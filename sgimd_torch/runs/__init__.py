"""A run as a thing on disk: options, parts, run directory, log, replay."""
