"""Figures of learning, movements, predictions and results. Needs matplotlib."""
