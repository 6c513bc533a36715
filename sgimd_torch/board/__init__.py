"""The board of a run: curves and pictures in TensorBoard. Needs tensorboardX."""
