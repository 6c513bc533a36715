"""Made-up tables of results in which every claim is true; tests change rows to make claims false."""

import numpy as np
import pandas as pd

from claimed import SUITE, TIMES
from table import FILE, LEARNING, TABLES, write_table
from variants import ARMS, EXPERIMENTS, FOUR, SPARSE

MOVEMENTS = (*TIMES, 5000)
SEEDS = 20
LETTER = {  # errors (m) after 5000 movements; learners by the letter of the paper have equal errors
    "random": 0.20,
    "sagg-riac": 0.15,
    "observation": 0.25,
    "imitation": 0.15,
    "sgim-d": 0.08,
    "sgim-d-teacher-1": 0.10,
    "sgim-d-teacher-2": 0.09,
    **{f"imitation-teacher-{k}": 0.15 for k in (1, 2)},
    **{f"observation-teacher-{k}": 0.24 for k in (1, 2)},
    "sagg-riac-large": 0.19,
    "sgim-d-large": 0.09,
}
ON_TASKS = {"random": 2.0, "uniform-nearest": 1.5}


def lettered(name):
    """The name of a learner by the letter of the paper, for the name of our learner."""
    for ending in ("-teacher-1", "-teacher-2", "-large"):
        if name.endswith(ending):
            return f"{name.removesuffix(ending)}-letter{ending} by paper"
    return f"{name}-letter by paper"


ERRORS = {  # errors (m) after 5000 movements by name, as in `Evidence`
    **LETTER,
    **{lettered(name): error for name, error in LETTER.items()},
    "sgim-d-uniform-large": 0.12,
    "sgim-d-absolute-large": 0.10,
    # Few movements, on the rod and on the suite.
    **dict.fromkeys(("cma-mae-taught", "map-elites-taught", "uniform-nearest-taught"), 0.3),
    **{f"{name}-once": 0.3 for name in ("cma-mae-taught", "map-elites-taught", "uniform-nearest-taught", "sgim-d")},
    "practice-taught-every-30": 0.03,
    "practice-taught": 0.02,
    **dict.fromkeys(("practice", "practice-wide"), 0.015),
    "practice-interest": 0.014,
    "cma-mae": 0.04,
    "map-elites": 0.05,
    "uniform-nearest": 0.08,
    "sgim-d-uniform": 0.10,
    **{f"{name}.{task}": error for name, error in ON_TASKS.items() for task in (*SUITE, *SPARSE) if task != "rod"},
    **{f"practice.{task}": 1.0 for task in (*SUITE, *SPARSE) if task != "rod"},
    "practice.rod-large": 0.015,
    **{f"sagg-riac.{task}": 1.5 for task in SPARSE},
    # With a forward model.
    **{f"sgim-d-model{by}": 0.03 for by in ("-alone by model-alone", " by model")},
    **{f"sgim-d.{arm}": 0.03 for arm in ARMS},
    **{f"sgim-d-model.{arm} by model": 0.03 for arm in ARMS},
    # Learners that ask.
    **dict.fromkeys(EXPERIMENTS["asking"], 0.019),
    "sgim-d-initial": 0.045,
    "sgim-im.toss": 0.5,
    "practice.toss-blind": 1.4,
}
ASKED = {  # variant: teacher: requests, shown, late, late_own
    **{name: {"all": (140, 110, 60, 60)} for name in EXPERIMENTS["asking"] if name.startswith("sgim")},
    "sgim-im-cost-10": {"all": (60, 50, 20, 20)},
    "sgim-acts-four": {**dict.fromkeys(FOUR[:3], (50, 40, 20, 0)), "mislabelling": (9, 8, 1, 0)},
    "sgim-acts-halves": {"low-half": (50, 40, 20, 19), "high-half": (50, 40, 30, 28)},
}
EXPLORED = {"random": (100, 0, 0), "sagg-riac": (200, 500, 1), "sgim-d": (300, 400, 50)}  # tiles, goals, near


def spread(name, seed):
    """Factor of the error of a seed; it differs from 1 by up to 2 %, for SAGG-RIAC by up to 6 %."""
    return 1 + (0.06 if name.startswith("sagg-riac") else 0.02) * (seed - (SEEDS - 1) / 2) / SEEDS


def error(name, seed, movements, last=None):
    """Error (m), which falls as 1 / movements to ``last`` at 5000 movements; the default of ``last`` is in ERRORS."""
    return (ERRORS[name] if last is None else last) * spread(name, seed) * (0.8 + 0.2 * 5000 / movements)


def row(variant, seed, movements, answer, error, floor=None, learning=LEARNING):
    """A row of results.csv."""
    values = (variant, seed, movements, answer, error, floor, learning)
    return dict(zip(TABLES[FILE][1], values, strict=True))


def write(folder, rows, name=FILE):
    """Write a table of these rows, which may lack the last column, and return its folder."""
    folder.mkdir(parents=True, exist_ok=True)
    columns = TABLES[name][1]
    rows = [row if len(row) == len(columns) else (*row, LEARNING) for row in rows]
    write_table(folder, name, pd.DataFrame(rows, columns=[*columns]))
    return folder


def write_rows(folder, spoilt=None, without=(), floor=0.98, asked=None, explored=None):
    """Write all tables.

    ``spoilt`` has factors of errors by name, one factor or one for each number of movements. ``without`` has names to
    leave out. ``floor`` is the noise floor divided by the error. ``asked`` and ``explored`` replace counts by variant.
    """
    rows = []
    for name in (name for name in ERRORS if name not in without):
        factors = (spoilt or {}).get(name, 1.0)
        variant, _, answer = name.partition(" by ")
        for seed in range(SEEDS):
            for movements in MOVEMENTS:
                factor = factors if np.isscalar(factors) else factors.get(movements, 1.0)
                value = factor * error(name, seed, movements)
                rows.append(row(variant, seed, movements, answer or "process", value, floor * value))
    requests = [
        (variant, seed, teacher, counts[0] + seed % 3, *counts[1:])
        for variant, teachers in {**ASKED, **(asked or {})}.items()
        for seed in range(SEEDS)
        for teacher, counts in teachers.items()
    ]
    reached = [
        (f"{name}{ending}", seed, tiles + seed, goals, near + (seed % 2) * (goals > 0))
        for name, (tiles, goals, near) in {**EXPLORED, **(explored or {})}.items()
        for ending in ("", "-large", "-letter", "-letter-large")
        for seed in range(SEEDS)
    ]
    write(folder, requests, "asked.csv")
    write(folder, reached, "explored.csv")
    return write(folder, rows)
