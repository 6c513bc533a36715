"""Global exploration: movements where the inverse model knows nothing (section 4.4.1)."""
