"""A made-up results/paper.csv in which every claim of the paper is true, to be spoilt by the tests."""

import numpy as np

from read_results import HEADER as COLUMNS

HEADER = ",".join(COLUMNS)
MOVEMENTS = (250, 500, 1000, 2000, 3000, 4000, 5000)
SEEDS = 20
TRUE = {  # variant: experiment, teacher, task space, error at 5000 (m), tiles reached
    "random": ("learners", "", 1, 0.20, 100),
    "sagg-riac": ("learners", "", 1, 0.15, 200),
    "observation": ("learners", 3, 1, 0.25, 0),
    "imitation": ("learners", 3, 1, 0.14, 150),
    "sgim-d": ("learners", 3, 1, 0.08, 300),
    **{f"sgim-d-teacher-{k}": ("teachers", k, 1, 0.09, 290) for k in (1, 2)},
    **{f"imitation-teacher-{k}": ("teachers", k, 1, 0.15, 150) for k in (1, 2)},
    **{f"observation-teacher-{k}": ("teachers", k, 1, 0.24, 0) for k in (1, 2)},
    "sagg-riac-large": ("large-space", "", 100, 0.19, 150),
    "sgim-d-large": ("large-space", 3, 100, 0.09, 290),
    "sagg-riac-absolute-large": ("large-space", "", 100, 0.21, 150),
    "sgim-d-absolute-large": ("large-space", 3, 100, 0.1, 280),
    "sgim-d-uniform-large": ("large-space", 3, 100, 0.12, 200),
    "sgim-d-long": ("long", 3, 1, 0.08, 300),
    "random-goals-demonstrations-large": ("large-space", 3, 100, 0.11, 250),
    "sgim-d-letter": ("letter", 3, 1, 0.11, 250),
    **{f"{name}-demonstrations": ("baselines", 3, 1, 0.095, 300) for name in ("random-goals", "cma-mae")},
    "cma-mae-demonstrations-tuned": ("baselines", 3, 1, 0.094, 300),
    "cma-mae": ("baselines", "", 1, 0.1, 300),
    "uniform-goals": ("ablations", 3, 1, 0.085, 290),
    "grid": ("ablations", 3, 1, 0.079, 300),
}


def spread(seed):
    """Seeds differ by up to 2 %."""
    return 1 + 0.02 * (seed - (SEEDS - 1) / 2) / SEEDS


def error(last, seed, movements):
    """Falls as 1 / movements towards four fifths of what it is at 5000, the noise floor."""
    return last * spread(seed) * (0.8 + 0.2 * 5000 / max(movements, 1) if movements < 5000 else 1.0)


def rows(variant, *, last=None, tiles=None, seeds=range(SEEDS), **changes):
    """The lines of one variant; ``last`` is its error at 5000, or a list of one for each seed."""
    experiment, teacher, task_space, usual, usual_tiles = {**TRUE, **changes}[variant]
    last = usual if last is None else last
    for seed in seeds:
        final = last if np.isscalar(last) else last[seed] / spread(seed)
        reached = (usual_tiles if tiles is None else tiles) + seed
        for movements in (*MOVEMENTS, 10_000) if experiment == "long" else MOVEMENTS:
            value = error(final, seed, movements)
            floor = 0.9 * final * spread(seed) if movements == 5000 else ""
            run = f"{experiment},{variant},{teacher},{task_space},{seed},{movements}"
            for answer, share in {"own": 1, "linear": 1, "process": 0.9}.items():
                yield f"{run},{answer},{share * value},{floor},{reached},{reached},{reached // 2}"


def write_paper(path, *, without=(), **spoilt):
    """``spoilt``: variant, with _ for -, to keywords of ``rows``."""
    spoilt = {variant.replace("_", "-"): change for variant, change in spoilt.items()}
    lines = [line for variant in TRUE if variant not in without for line in rows(variant, **spoilt.get(variant, {}))]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join([HEADER, *lines]) + "\n")
    return path
