"""Films of what a run has learnt, drawn by MuJoCo or in the plane."""
