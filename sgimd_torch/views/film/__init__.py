"""Films of what a run has learnt. Needs MuJoCo and a way to draw."""
