"""The board: curves and pictures of a run in TensorBoard. Needs tensorboardX."""
