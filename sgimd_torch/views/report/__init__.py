"""One page about one run, or about many side by side."""
