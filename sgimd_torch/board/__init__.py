"""What a run shows in TensorBoard. Needs tensorboard."""
