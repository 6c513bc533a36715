"""Every experiment as data: each variant has the options in which it differs from the defaults of ``sgimd run``.

Section 6 of Nguyen & Oudeyer (2014) comes first, then further experiments.
    EXPERIMENTS["rivals"]["sgim-d-uniform"]        # {"algorithm": "sgim-d", "goals": "uniform", ...}
A variant on the rod has a plain name, on another task the name of the task at its end: practice.toss.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

from sgimd_torch.demonstrations import SHIPPED
from suite import REFERENCES, TASKS, UNIFORM

Variant = dict[str, Any]
ARMS: Final = ("planar-arm-7", "planar-arm-50")
SGIM_D: Final[Variant] = {"algorithm": "sgim-d"}
SAGG_RIAC: Final[Variant] = {"algorithm": "sagg-riac"}
SPARSE: Final = ("puck", "fetch")  # tasks where most movements do nothing
ROD: Final = "rod"
WHOLE: Final[Variant] = {"evaluate_at": (250, 500, 1000, 2000, 5000)}
END: Final[Variant] = {"evaluate_at": (5000,)}
SHORT: Final[Variant] = {"movements": 2000, "evaluate_at": (250, 500, 1000, 2000)}
FLOOR: Final[Variant] = {"floor_at": (5000,), "repeats": 3}  # measures the noise floor, too
SGIM_D_LETTER: Final[Variant] = {"algorithm": "sgim-d-letter"}
SAGG_RIAC_LETTER: Final[Variant] = {"algorithm": "sagg-riac-letter"}
INVERSE: Final[Variant] = {"inverse": "paper"}  # the letter of the paper for learners without goals
VARIED: Final[Variant] = {**INVERSE, "exact_first": False}  # the same for imitation
LARGE: Final[Variant] = {"environment.task_space": 100.0}
BASELINE: Final[Variant] = {"goals": "uniform", "inverse": "nearest", "search": "perturb"}  # standard baseline
ONCE: Final[Variant] = {"teacher": "initial", "teacher.every": 1}  # at the start, one demonstration a movement
PRACTICE: Final[Variant] = {"algorithm": "practice"}
WIDE: Final[Variant] = {**PRACTICE, "explore.uniform": 1.0}  # the first movements are uniform, too
TAUGHT: Final[Variant] = {"algorithm": "practice-taught", **ONCE}
UNTAUGHT: Final[dict[str, Variant]] = {"random": {"algorithm": "random"}, UNIFORM: REFERENCES[UNIFORM]}
# Steps from the standard baseline to `practice`.
MIDDLE: Final[Variant] = {**REFERENCES[UNIFORM], "explore": "returning"}
# SGIM-D with a forward model that answers once it predicts as well as `process`, and with one that answers untested.
MODEL: Final[dict[str, Variant]] = {
    "sgim-d-model": {**SGIM_D, "inverse": "model", "search": "gradient"},
    "sgim-d-model-alone": {**SGIM_D, "inverse": "model-alone", "search": "gradient"},
}

# Learners that ask.
IM: Final[Variant] = {"algorithm": "sgim-im"}
ACTS: Final[Variant] = {"algorithm": "sgim-acts"}
MISLABELLING: Final = "mislabelling"  # name of this teacher in asked.csv
RECORDED: Final = ("demonstrator-1", "demonstrator-2", "demonstrator-3")
FOUR: Final = (*RECORDED, MISLABELLING)
HALVES: Final = ("low-half", "high-half")


def _of_teacher(teacher: int, ending: str = "") -> dict[str, Variant]:
    """Learners taught by demonstrator 1 or 2; with the ending "-letter" they learn by the letter of the paper."""
    letter = {"sgim-d": SGIM_D_LETTER, "imitation": VARIED, "observation": INVERSE}
    return {
        f"{algorithm}{ending}-teacher-{teacher}": {
            "algorithm": algorithm,
            "demonstrations": SHIPPED.with_name(f"demonstrator_{teacher}.npz"),
            **(options if ending else {}),
            **END,
        }
        for algorithm, options in letter.items()
    }


def _on_tasks(learners: dict[str, Variant], tasks: Iterable[str]) -> dict[str, Variant]:
    """Each learner on each task except the rod."""
    return {
        f"{name}.{task}": {**line, **TASKS[task].options, **SHORT}
        for task in tasks
        for name, line in learners.items()
        if task != ROD
    }


EXPERIMENTS: Final[dict[str, dict[str, Variant]]] = {
    "paper": {
        **{name: {"algorithm": name, **WHOLE} for name in ("random", "sagg-riac", "observation", "imitation")},
        "sgim-d": {**SGIM_D, **WHOLE, **FLOOR},
    },
    "letter": {
        "random-letter": {"algorithm": "random", **INVERSE, **WHOLE},
        "sagg-riac-letter": {**SAGG_RIAC_LETTER, **WHOLE},
        "observation-letter": {"algorithm": "observation", **INVERSE, **WHOLE},
        "imitation-letter": {"algorithm": "imitation", **VARIED, **WHOLE},
        "sgim-d-letter": {**SGIM_D_LETTER, **WHOLE, **FLOOR},
    },
    "large": {
        name: {**line, **LARGE, **WHOLE}
        for name, line in {
            "sagg-riac-large": SAGG_RIAC,
            "sgim-d-large": SGIM_D,
            "sgim-d-uniform-large": {**SGIM_D, "goals": "uniform"},
            "sgim-d-absolute-large": {**SGIM_D, "goals.progress": "absolute"},
            "sagg-riac-letter-large": SAGG_RIAC_LETTER,
            "sgim-d-letter-large": SGIM_D_LETTER,
        }.items()
    },
    "teachers": {
        name: line
        for ending in ("", "-letter")
        for teacher in (1, 2)
        for name, line in _of_teacher(teacher, ending).items()
    },
    "rivals": {
        name: {**line, **WHOLE}
        for name, line in {
            UNIFORM: REFERENCES[UNIFORM],
            "cma-mae": {"algorithm": "cma-mae"},
            "map-elites": {"algorithm": "map-elites"},
            "uniform-nearest-taught": {**SGIM_D, **BASELINE},
            "uniform-nearest-taught-once": {**SGIM_D, **BASELINE, **ONCE, "social.repeats": 1},
            "sgim-d-uniform": {**SGIM_D, "goals": "uniform"},
            "sgim-d-once": {**SGIM_D, **ONCE, "social.repeats": 1},
            "cma-mae-taught": {"algorithm": "cma-mae-taught"},
            "cma-mae-taught-once": {"algorithm": "cma-mae-taught", "imitations": 1, **ONCE},
            "map-elites-taught": {"algorithm": "map-elites-taught"},
            "map-elites-taught-once": {"algorithm": "map-elites-taught", "imitations": 1, **ONCE},
            "cma-me": {"algorithm": "cma-me"},
            "cma-me-taught": {"algorithm": "cma-me-taught"},
            # Rivals with tuned settings: better than the defaults in a search on seeds 1000 and 1001.
            "map-elites-tuned": {"algorithm": "map-elites", "cells": 10},
            "cma-me-tuned": {"algorithm": "cma-me", "sd": 0.05},
            "cma-mae-taught-tuned": {"algorithm": "cma-mae-taught", "sd": 0.05},
            "home-babbling": {"algorithm": "experiments.rivals:home_babbling"},
            "random-middle": {**MIDDLE, "inverse": "process", "explore.first": 1_000_000},
            "map-elites-middle": {"algorithm": "experiments.rivals:map_elites_middle"},
            "middle": MIDDLE,
            "middle-process": {**MIDDLE, "inverse": "process"},
        }.items()
    },
    "suite": _on_tasks(UNTAUGHT, TASKS) | _on_tasks({"sagg-riac": SAGG_RIAC}, SPARSE),
    "model": {
        **{name: {**line, **WHOLE} for name, line in MODEL.items()},
        **_on_tasks({"sgim-d": SGIM_D, "sgim-d-model": MODEL["sgim-d-model"]}, ARMS),
    },
    "practice": {
        **{
            name: {**line, **WHOLE}
            for name, line in {
                "practice": PRACTICE,
                "practice-wide": WIDE,
                "practice-interest": {**PRACTICE, "goals": "interest-map"},
                "practice-taught-every-30": {
                    "algorithm": "practice-taught",
                    "teacher": "periodic",
                    "social.repeats": 10,
                },
            }.items()
        },
        "practice-taught": {**TAUGHT, **WHOLE, **FLOOR},
        **_on_tasks({"practice": PRACTICE}, TASKS),
        **_on_tasks({"practice-wide": WIDE}, (task for task in TASKS if task not in SPARSE)),
    },
    "asking": {
        **{
            name: {**line, **WHOLE}
            for name, line in {
                "sgim-d-initial": {**SGIM_D, "teacher": "initial"},
                "sgim-im": IM,
                "sgim-im-cost-10": {**IM, "cost": 10.0},
                **{f"sgim-acts-{number}": {**ACTS, "teachers": (f"demonstrator-{number}",)} for number in (1, 2)},
                "sgim-acts-four": {**ACTS, "teachers": (*RECORDED, f"experiments.mislabelling:{MISLABELLING}")},
                "sgim-acts-halves": {**ACTS, "teachers": HALVES},
            }.items()
        },
        "sgim-im.toss": {**IM, **TASKS["toss"].options, **SHORT},
        "practice.toss-blind": {**PRACTICE, "environment": "experiments.toys:blind_toss", **SHORT},
    },
}
VARIANTS: Final = {name: line for variants in EXPERIMENTS.values() for name, line in variants.items()}
# Seeds of each experiment, set out before the first was used: twenty where the paper's claims are judged, else ten.
SEEDS: Final = {
    **dict.fromkeys(EXPERIMENTS, range(280, 290)),
    **dict.fromkeys(("paper", "letter"), range(280, 300)),
}
# The second table, beside results.csv, that gets rows from the runs of an experiment.
SMALL_TABLES: Final = {"asking": "asked.csv", **dict.fromkeys(("paper", "letter", "large"), "explored.csv")}
