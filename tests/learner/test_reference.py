"""Runs of which every movement is known: as long as they come out the same, learning has not changed."""

import pytest

from marks import slow
from reference import ALL, KEPT, check_errors, check_movements, lived

ARM = {"environment": "planar-arm-7"}
VARIANTS = {
    "sgim-d": {"algorithm": "sgim-d"},
    "practice-taught": {"algorithm": "practice-taught"},
    "practice": {"algorithm": "practice", **ARM},
    "sagg-riac": {"algorithm": "sagg-riac", **ARM},
    "imitation": {"algorithm": "imitation"},
    "model": {"algorithm": "sgim-d", **ARM, "inverse": "model-alone", "search": "gradient"},
    "random": {"algorithm": "random"},
    "observation": {"algorithm": "observation", **ARM},
}
RUNS = [f"{name} {seed}" for name in VARIANTS for seed in (1000, 1001) if name not in ("random", "observation")]
RUNS += ["random 1000", "observation 1000"]
TORCH = [slow(run) if run.startswith("model") else run for run in RUNS]


@pytest.mark.parametrize("run", TORCH)
def test_a_run_makes_the_movements_that_it_always_made(run, tmp_path):
    check_movements(lived(run, VARIANTS[run.split()[0]], tmp_path, KEPT), run)


@pytest.mark.slow
@pytest.mark.parametrize("run", RUNS)
def test_a_run_in_two_parts_ends_with_the_errors_that_it_always_had(run, tmp_path):
    found = lived(run, VARIANTS[run.split()[0]], tmp_path, ALL, 130)
    check_movements(found, run)
    check_errors(found, run)
