"""Global exploration: movements that do not depend on the goal (section 4.4.1)."""
