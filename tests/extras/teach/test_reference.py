"""Two runs with lessons by hand of which every movement is known, as in tests/learner/test_reference.py."""

from pathlib import Path

import numpy as np
import pytest

from sgimd_torch.demonstrations import load_demonstrations
from sgimd_torch.options.build import build
from sgimd_torch.options.config import Config
from sgimd_torch.runs.read import read_run
from sgimd_torch.runs.run import RunLoop

KEPT = 60
LESSONS = {0: 0, 37: 5, 38: 10, 120: 15, 200: 20}  # number of movements before a lesson -> demonstration
REFERENCE = Path(__file__).parents[1] / "learner" / "reference.npz"


def lived(seed, movements, out, *stops):
    """The record of a run with lessons; it is stopped and resumed after each number of movements in ``stops``."""
    settings = {"algorithm": "sgim-d", "teacher": "by-hand", "seed": seed, "movements": movements, "out": out}
    judged = {"evaluate_at": [] if movements == KEPT else [120], "repeats": 2, "floor_at": [240]}
    config = Config.from_settings({**settings, **judged})
    shown = load_demonstrations()
    for last in [*stops, movements]:
        parts = build(config)
        with RunLoop(parts, resume=last != [*stops, movements][0]) as life:
            if not life.recorded:
                parts.teacher.give(shown[LESSONS[0]])
            for episode in life.episodes():
                made = episode.index + 1
                if made == last:
                    break
                if made in LESSONS and not life.replaying:
                    parts.teacher.give(shown[LESSONS[made]])
    return read_run(config.directory)


@pytest.fixture(scope="module")
def reference():
    with np.load(REFERENCE) as kept:
        return dict(kept)


def check_movements(found, reference, run):
    for column in ("contexts", "thetas", "goals", "outcomes"):
        kept = reference[f"{run}/{column}"]
        np.testing.assert_allclose(getattr(found, column)[:KEPT], kept, rtol=1e-9, atol=1e-12, err_msg=column)
    assert found.origin[:KEPT].tolist() == reference[f"{run}/origin"].tolist()


@pytest.mark.parametrize("seed", [1000, 1001])
def test_a_run_with_lessons_makes_the_movements_that_it_always_made(seed, tmp_path, reference):
    check_movements(lived(seed, KEPT, tmp_path), reference, f"by-hand {seed}")


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1000, 1001])
def test_a_resumed_run_with_lessons_ends_with_the_errors_that_it_always_had(seed, tmp_path, reference):
    found = lived(seed, 240, tmp_path, 130)
    check_movements(found, reference, f"by-hand {seed}")
    for inverse, table in found.evaluations.items():
        kept = reference[f"by-hand {seed}/errors/{inverse}"]
        columns = [table[name] for name in ("movements", "mean_error", "median_error", "noise_floor")]
        np.testing.assert_allclose(np.stack(columns), kept, rtol=1e-9)
