"""The option ``--logger`` of a run: a logger of Lightning gets all points of the board's curves, replayed ones, too."""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Mapping
from typing import Any, ClassVar, Final

from sgimd_torch.board import board_of
from sgimd_torch.runs.hooks import Hook, Listener
from sgimd_torch.texts import unknown_name_error

NEEDS_PACKAGE: Final = {"csv": "lightning", "wandb": "wandb", "mlflow": "mlflow"}


class Logging(Hook):
    """Curves for another tracker.

    Args:
        logger: other tracker of the curves: csv, wandb or mlflow; null: none.
    """

    may_change: ClassVar = ("logger",)
    compared: ClassVar = False

    def __init__(self, *, logger: str | None = None) -> None:
        if logger is not None and logger not in NEEDS_PACKAGE:
            raise unknown_name_error("logger", logger, NEEDS_PACKAGE)
        for package in ("lightning", NEEDS_PACKAGE[logger]) if logger else ():
            if importlib.util.find_spec(package) is None:
                raise ValueError(f"--logger {logger} needs {package}, which is not installed; pip install {package}")
        self.logger = logger

    def built(self, parts: Any) -> None:
        """Refuse a run without a board."""
        if self.logger and not parts.config["board"]:
            raise ValueError(f"--logger {self.logger} needs --board true, whose curves it gets")

    def listener(self, loop: Any) -> Listener | None:
        """A listener that hands the points over; the logger's files are in the run's folder, or in OUT/mlruns."""
        if self.logger is None:
            return None
        from lightning.pytorch import loggers  # takes seconds

        board, config, name = board_of(loop), loop.parts.config, "sgimd_torch"
        if self.logger == "csv":
            return Logged(loggers.CSVLogger(config.directory, name="csv"), board)
        if self.logger == "wandb":
            return Logged(loggers.WandbLogger(config.title, config.directory, project=name, offline=True), board)
        return Logged(loggers.MLFlowLogger(name, config.title, f"file:{config.out.resolve()}/mlruns"), board)


class Logged(Listener):
    """Keeps the points of a ``board``, and hands them to a ``logger`` when the record is written, row by row."""

    def __init__(self, logger: Any, board: Any) -> None:
        self._logger, self._board, self._rows = logger, board, dict[int, dict[str, float]]()
        board.trackers.append(self._hear)

    def _hear(self, step: int, values: Mapping[str, float]) -> None:
        tidy = {re.sub(r"[^\w/. -]", "", tag, flags=re.ASCII): value for tag, value in values.items()}  # as MLflow asks
        self._rows.setdefault(step, {}).update(tidy)

    def begin(self) -> None:
        self._logger.log_hyperparams(self._board.hparams)

    def flush(self) -> None:
        for step in sorted(self._rows):
            self._logger.log_metrics(self._rows.pop(step), step)
        self._logger.save()

    def close(self) -> None:
        self._logger.finalize("success")
