"""Runs of which every movement is known: ``reference.npz`` has their first 60 movements, of 240, and their evaluations
after 120 and 240. Another processor rounds otherwise, and each movement builds on those before it: two processors
differed by 1e-9, and by 1e-5 in movements (3 % in the last errors) that come from the network, which is trained in
single precision."""

from pathlib import Path

import numpy as np

from sgimd_torch.options.config import Config
from sgimd_torch.runs.build import build
from sgimd_torch.runs.read import read_run
from sgimd_torch.runs.run import RunLoop

KEPT, ALL = 60, 240


def lived(run, settings, out, movements, *stops, lessons=None):
    """A run such as "sgim-d 1000", stopped and resumed after each number of movements in ``stops``; ``lessons``:
    function that gives lessons by hand after a number of movements."""
    judged = {"evaluate_at": [] if movements == KEPT else [120], "repeats": 2, "floor_at": [ALL]}
    seed = int(run.split()[1])
    config = Config.from_settings({**settings, **judged, "seed": seed, "movements": movements, "out": out})
    for last in [*stops, movements]:
        parts = build(config)
        with RunLoop(parts, resume=config.directory.exists()) as life:
            if lessons and not life.recorded:
                lessons(parts.teacher, 0)
            for episode in life.episodes():
                made = episode.index + 1
                if made == last:
                    break
                if lessons and not life.replaying:
                    lessons(parts.teacher, made)
    return read_run(config.directory)


def check_movements(found, run):
    kept = _kept()
    for column in ("contexts", "thetas", "goals", "outcomes"):
        bound = 1e-3 if run.startswith("model") else 1e-6  # in shares of a side of Theta, and in metres
        np.testing.assert_allclose(
            getattr(found, column)[:KEPT], kept[f"{run}/{column}"], rtol=0, atol=bound, err_msg=column
        )
    assert found.origin[:KEPT].tolist() == kept[f"{run}/origin"].tolist()


def check_errors(found, run):
    kept = _kept()
    for inverse, table in found.evaluations.items():
        columns = [table[name] for name in ("movements", "mean_error", "median_error", "noise_floor")]
        bound = 0.1 if run.startswith("model") else 1e-6
        np.testing.assert_allclose(np.stack(columns), kept[f"{run}/errors/{inverse}"], rtol=bound)


def _kept():
    with np.load(Path(__file__).with_name("reference.npz")) as kept:
        return dict(kept)
