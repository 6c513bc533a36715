"""Made-up tables of results in which every claim is true, to be spoilt by the tests."""

import numpy as np
import pandas as pd

from asking_claims import FOUR
from learning_claims import TIMES
from paper_claims import JUDGED
from sgimd_torch.views.suite import TASKS
from table import FILE, TABLES, write_table
from variants import EXPERIMENTS, LEARNING, PROVED

MOVEMENTS = (250, 500, 1000, 2000, 3000, 4000, 5000)
SEEDS = 20
PAPER = {  # variant: experiment, teacher, half side of T (m), error at 5000 (m), tiles reached
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
_WITH_MODEL = {500: 0.1, 1000: 0.06, 2000: 0.04, 3000: 0.035, 5000: 0.03}
MODEL = {  # variant: experiment, its errors (m) by movements
    "sgim-d": ("forward-model", {500: 0.1, 1000: 0.08, 2000: 0.06, 3000: 0.05, 5000: 0.045}),
    **dict.fromkeys(JUDGED, ("forward-model", _WITH_MODEL)),
    "sagg-riac": ("forward-model", {500: 0.2, 1000: 0.15, 2000: 0.1, 3000: 0.09, 5000: 0.08}),
    "sagg-riac-model": ("forward-model", {500: 0.2, 1000: 0.14, 2000: 0.09, 3000: 0.08, 5000: 0.07}),
    "sgim-d-arm-50": ("planar-arm-50", {250: 0.2, 500: 0.1, 1000: 0.05, 2000: 0.03}),
    **{f"{name}-arm-50": ("planar-arm-50", {250: 0.2, 500: 0.1, 1000: 0.03, 2000: 0.01}) for name in JUDGED},
}
_BEST = (0.09, 0.06, 0.04, 0.036, 0.03)
ROD = {  # variant: its errors (m) at TIMES and 5000
    **dict.fromkeys(LEARNING, (0.2, 0.17, 0.15, 0.13, 0.12)),
    **dict.fromkeys(("practice-taught.rod", "practice-corner.rod", "practice-shuffled.rod"), _BEST),
    "practice.rod": (0.1, 0.07, 0.05, 0.04, 0.036),
    "cma-mae.rod": (0.3, 0.2, 0.1, 0.08, 0.07),
    "sgim-d.rod": (0.2, 0.1, 0.07, 0.05, 0.045),
    "sgim-d-uniform.rod": (0.2, 0.1, 0.08, 0.06, 0.05),
}
SUITE = {"random-nearest": 2.0, "uniform-nearest": 1.5, "practice": 1.0, "cma-mae": 1.4, "map-elites": 1.3}
_NOT_ASKING = ("taught-every-30", "taught-at-start", "taught-at-start-once", "alone", "alone-toss", "alone-toss-blind")
ASKING = {
    **dict.fromkeys(EXPERIMENTS["asking"], (0.1, 0.07, 0.04, 0.036, 0.03)),
    **dict.fromkeys((*_NOT_ASKING, "sgim-eer"), (0.2, 0.15, 0.07, 0.06, 0.046)),
}
ASKED = {  # variant: teacher: requests, shown, late, late_own, strong, weak
    **{name: {"all": (140, 110, 60, 60, 50, 40)} for name in EXPERIMENTS["asking"] if name not in _NOT_ASKING},
    "sgim-im-83": {"all": (100, 83, 10, 10, 0, 0)},
    "sgim-im-cost-10": {"all": (60, 50, 20, 20, 0, 0)},
    "sgim-acts-four": {**dict.fromkeys(FOUR[:3], (50, 40, 20, 0, 0, 0)), "mislabelling": (9, 8, 1, 0, 0, 0)},
    "sgim-acts-halves": {"low-half": (50, 40, 20, 19, 0, 0), "high-half": (50, 40, 30, 28, 0, 0)},
}


def spread(seed):
    """Seeds differ by up to 2 %."""
    return 1 + 0.02 * (seed - (SEEDS - 1) / 2) / SEEDS


def middle(last):
    """The interquartile mean over the seeds."""
    return last * np.mean([spread(seed) for seed in range(SEEDS // 4, SEEDS - SEEDS // 4)])


def error(last, seed, movements):
    """Falls as 1 / movements towards four fifths of what it is at 5000, the noise floor."""
    return last * spread(seed) * (0.8 + 0.2 * 5000 / max(movements, 1) if movements < 5000 else 1.0)


def row(experiment, variant, seed, movements, answer, error, own=0, floor=None, tiles=1, teacher="", task_space=1.0):
    """A row of results.csv; as many goals are claimed as tiles reached, half of them met."""
    values = (variant, seed, movements, answer, own, "fishing-rod", str(teacher), task_space, error, floor)
    return dict(zip(TABLES[FILE][1], (experiment, *values, tiles, tiles, tiles // 2), strict=True))


def write(folder, rows, name=FILE):
    """A table of these rows; returns the folder."""
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    columns = TABLES[name][1]
    write_table(folder, name, pd.DataFrame([*rows], columns=[*columns]))
    return folder


def undashed(spoilt):
    """Variants as keywords have _ for -."""
    return {name.replace("_", "-"): change for name, change in spoilt.items()}


def paper_rows(variant, *, last=None, tiles=None, seeds=range(SEEDS)):
    """The rows of one variant; ``last`` is its error at 5000, or a list of one for each seed."""
    experiment, teacher, task_space, usual, usual_tiles = PAPER[variant]
    last = usual if last is None else last
    for seed in seeds:
        final = last if np.isscalar(last) else last[seed] / spread(seed)
        reached = (usual_tiles if tiles is None else tiles) + seed
        for movements in (*MOVEMENTS, 10_000) if experiment == "long" else MOVEMENTS:
            value = error(final, seed, movements)
            for answer, own, share in (("paper", 1, 1), ("linear", 0, 1), ("process", 0, 0.9)):
                floor = 0.9 * final * spread(seed) if own and movements == 5000 else None
                place = (experiment, variant, seed, movements, answer)
                yield row(*place, share * value, own, floor, reached, teacher, task_space)


def write_goals(folder, sgim_d=(40, 60, 50, 45, 55), sagg_riac=(1, 0, 2, 1, 1)):
    """Of 400 goals of SGIM-D and 500 of SAGG-RIAC so many are near, seed by seed."""
    rows = [("sgim-d-large", seed, 400, near) for seed, near in enumerate(sgim_d)]
    rows += [("sagg-riac-large", seed, 500, near) for seed, near in enumerate(sagg_riac)]
    return write(folder, rows, "goals.csv")


def write_paper(folder, *, without=(), **spoilt):
    """``spoilt``: variant, with _ for -, to keywords of ``paper_rows``."""
    spoilt = undashed(spoilt)
    rows = [each for name in PAPER if name not in without for each in paper_rows(name, **spoilt.get(name, {}))]
    write_goals(folder)
    return write(folder, rows)


def write_model(folder, *, without=(), **spoilt):
    """``spoilt``: to errors in the place of the true ones."""
    rows = [
        row(experiment, name, seed, movements, "model", error * spread(seed), 1, 0.033 if movements == 5000 else None)
        for name, (experiment, errors) in MODEL.items()
        if name not in without
        for seed in range(SEEDS)
        for movements, error in {**errors, **undashed(spoilt).get(name, {})}.items()
    ]
    return write(folder, rows)


def write_learning(folder, *, floor=0.0295, linear=2.0, by_model=1.0, tasks=TASKS, suite=None, **spoilt):
    """``by_model``: how much worse the own answer is where it has a model. ``suite``: (variant, movements, answer) to a
    factor. ``spoilt``: variant of the rod, without ".rod", to errors in the place of the true ones."""
    on_rod = suite or (lambda name, when, answer: 1.0)
    on_suite = suite or (lambda name, when, answer: 1.2 if answer == "linear" else 1.0)
    factors = {"nearest": 1.0, "linear": linear, "process": 1.0}
    curves = {**ROD, **{f"{name}.rod": given for name, given in undashed(spoilt).items()}}
    rows = [
        row(
            "learning", name, seed, when, answer, value * factor * on_rod(name, when, answer) * spread(seed), own, floor
        )
        for name, curve in curves.items()
        for seed in range(SEEDS)
        for when, value in zip((*TIMES, 5000), curve, strict=True)
        for answer, factor, own in (
            *((answer, factor, 0) for answer, factor in factors.items()),
            ("paper", by_model if name == "imitation.rod" else 1, 1),
        )
    ]
    rows += [
        row(
            *("suite", name, seed, when, answer),
            SUITE[name.partition(".")[0]] * on_suite(name, when, answer) * 50 / when * spread(seed),
        )
        for name in EXPERIMENTS["suite"]
        if name.partition(".")[2] in tasks
        for seed in range(SEEDS)
        for when in TIMES
        for answer in PROVED[1:]
    ]
    return write(folder, rows)


def write_asking(folder, *, asked=None, without=(), **spoilt):
    """``spoilt``: variant to errors in the place of the true ones; ``asked``: to other requests."""
    curves = {name: curve for name, curve in {**ASKING, **undashed(spoilt)}.items() if name not in without}
    write(
        folder,
        [
            row("asking", name, seed, when, "process", value * spread(seed), 1)
            for name, curve in curves.items()
            for seed in range(SEEDS)
            for when, value in zip((*TIMES, 5000), curve, strict=True)
        ],
    )
    counts = [
        (variant, seed, teacher, found[0] + seed % 3, *found[1:])
        for variant, teachers in {**ASKED, **(asked or {})}.items()
        if variant not in without
        for seed in range(SEEDS)
        for teacher, found in teachers.items()
    ]
    write(folder, counts, "asked.csv")
    parts = [
        (name, seed, low, low + 2, factor * abs(low + 1) + 0.04)
        for name, factor in (("alone-toss", 0.02), ("sgim-im-toss", 0.01))
        for seed in range(SEEDS)
        for low in (-3.0, -1.0, 1.0)
    ]
    return write(folder, parts, "contexts.csv")
