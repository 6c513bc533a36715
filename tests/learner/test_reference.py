"""Sixteen runs of which every movement is known: as long as they come out the same, learning has not changed.

``reference.npz`` has their first 60 movements, of 240, and their evaluations after 120 and 240. Another processor
rounds otherwise, and each movement builds on those before it: two processors differed by 1e-9, and by 1e-5 in movements
(3 % in the last errors) that come from the network, which is trained in single precision.
"""

from pathlib import Path

import numpy as np
import pytest

from sgimd_torch.options.build import build
from sgimd_torch.options.config import Config
from sgimd_torch.runs.read import read_run
from sgimd_torch.runs.run import RunLoop

KEPT = 60
ARM = {"environment": "planar-arm-7"}
VARIANTS = {
    "sgim-d": {"algorithm": "sgim-d"},
    "practice-taught": {"algorithm": "practice-taught"},
    "practice": {"algorithm": "practice", **ARM},
    "sagg-riac": {"algorithm": "sagg-riac", **ARM},
    "imitation": {"algorithm": "imitation"},
    "model": {"algorithm": "sgim-d", **ARM, "inverse": "model-alone", "search": "gradient"},
    "sgim-acts": {"algorithm": "sgim-acts-search", "teachers": ("low-half", "high-half"), **ARM},
    "random": {"algorithm": "random"},
    "observation": {"algorithm": "observation", **ARM},
}
RUNS = [f"{name} {seed}" for name in VARIANTS for seed in (1000, 1001) if name not in ("random", "observation")]
RUNS += ["random 1000", "observation 1000"]
TORCH = [pytest.param(run, marks=pytest.mark.slow) if run.startswith("model") else run for run in RUNS]


def config_of(run, movements, out):
    """The configuration of a reference run, of so many movements."""
    name, seed = run.split()
    fixed = {
        "seed": int(seed),
        "movements": movements,
        "evaluate_at": [] if movements == KEPT else [120],
        "repeats": 2,
        "floor_at": [240],
        "out": out,
    }
    return Config.from_settings({**VARIANTS[name], **fixed})


def lived(run, movements, out, *, until=None):
    """The run as it was recorded; ``until``: stopped after so many movements, and gone on with."""
    config = config_of(run, movements, out)
    for last in [movements] if until is None else [until, movements]:
        parts = build(config)
        with RunLoop(parts, resume=last != until and until is not None) as life:
            for episode in life.episodes():
                if episode.index + 1 == last:
                    break
    return read_run(config.directory)


@pytest.fixture(scope="module")
def reference():
    with np.load(Path(__file__).with_name("reference.npz")) as kept:
        return dict(kept)


def check_movements(found, reference, run):
    for column in ("contexts", "thetas", "goals", "outcomes"):
        kept = reference[f"{run}/{column}"]
        bound = 1e-3 if run.startswith("model") else 1e-6  # in shares of a side of Theta, and in metres
        np.testing.assert_allclose(getattr(found, column)[:KEPT], kept, rtol=0, atol=bound, err_msg=column)
    assert found.origin[:KEPT].tolist() == reference[f"{run}/origin"].tolist()


@pytest.mark.parametrize("run", TORCH)
def test_a_run_makes_the_movements_that_it_always_made(run, tmp_path, reference):
    check_movements(lived(run, KEPT, tmp_path), reference, run)


@pytest.mark.slow
@pytest.mark.parametrize("run", RUNS)
def test_a_run_in_two_parts_ends_with_the_errors_that_it_always_had(run, tmp_path, reference):
    found = lived(run, 240, tmp_path, until=130)
    check_movements(found, reference, run)
    for inverse, table in found.evaluations.items():
        kept = reference[f"{run}/errors/{inverse}"]
        columns = [table[name] for name in ("movements", "mean_error", "median_error", "noise_floor")]
        np.testing.assert_allclose(np.stack(columns), kept, rtol=0.1 if run.startswith("model") else 1e-6)
