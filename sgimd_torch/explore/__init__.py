"""Global exploration: where to look when the inverse model knows nothing (section 4.4.1)."""
