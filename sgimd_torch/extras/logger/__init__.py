"""The curves of the board for other trackers: CSV, Weights & Biases, MLflow, by Lightning's loggers."""

WORDS = "hook  hook  logger=Logging"
INSTALL = "forward"
