"""Every experiment as data: each variant has the options in which it differs from the defaults of ``sgimd run``.

Section 6 of Nguyen & Oudeyer (2014) comes first, then further experiments.
    EXPERIMENTS["ablations"]["uniform-goals"]        # {"algorithm": "sgim-d", "goals": "uniform"}
A variant of two experiments has equal options in both. It is run once, and both experiments get its rows.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from sgimd_torch.demonstrations import SHIPPED, load_demonstrations, save_demonstrations
from sgimd_torch.files import make_folder
from sgimd_torch.spaces import stream
from sgimd_torch.views.suite import REFERENCES, TASKS, UNIFORM

Variant = dict[str, Any]
ARMS: Final = ("planar-arm-7", "planar-arm-50")
SWIMMERS: Final = ("random", "sagg-riac", "sgim-d")
SGIM_D: Final[Variant] = {"algorithm": "sgim-d"}
SAGG_RIAC: Final[Variant] = {"algorithm": "sagg-riac"}
# The algorithm practice with uniform goals and without a search for effects. Taught on the rod, a learner with these
# options makes the same movements as the default `practice-taught`.
UNIFORM_PRACTICE: Final[Variant] = {
    "algorithm": "practice",
    "goals": "uniform",
    "explore": "widening",
    "inverse": "process",
}
SPARSE: Final = ("puck", "fetch")  # tasks where most movements do nothing
SUITE: Final = {task: suited for task, suited in TASKS.items() if task not in SPARSE}
EXACT: Final[Variant] = {"search.noise": 0.0}  # the simplex without noise
COMPLETE: Final[Variant] = {
    "search.complete": True,
    "search.xatol": 1e-4,
    "search.fatol": 1e-4,
}  # ends by the budget
# Steps from the letter of the paper to our defaults, one change at a time: name, options before, options after. The
# paper gives no numbers for the budget of a goal and for g_max. A budget of 60 movements, more than the 30 between two
# demonstrations, sets no limit.
STEPS: Final[tuple[tuple[str, Variant, Variant], ...]] = (
    ("inverse", {"inverse": "paper"}, {"inverse": "linear"}),
    ("simplex", COMPLETE, {"search.complete": False, "search.xatol": 0.1, "search.fatol": 0.05}),
    ("budget", {"budget": 60}, {"budget": 15}),
    ("noise", EXACT, {"search.noise": 0.05}),
    ("progress", {"goals.progress": "absolute"}, {"goals.progress": "gained"}),
    ("giving-up", {"give_up": -1.0}, {"give_up": -0.5}),
    ("regions", {"goals.g_max": 50}, {"goals.g_max": 30}),
    ("slivers", {"goals.max_aspect": 1e9}, {"goals.max_aspect": 5.0}),
    ("proof", {"inverse": "linear"}, {"inverse": "process"}),  # the last step leads to our defaults
)
LETTER: Final[Variant] = {option: value for _, was, _ in reversed(STEPS) for option, value in was.items()}
INVERSE: Final[Variant] = {"inverse": "paper"}  # the letter of the paper for learners without goals
# Inverse models whose errors a page shows: `process` for every learner, and further ones for some learners. These are
# eq. (9) for the letter of the paper, `linear` for a step of the ladder, and a forward model where one is trained.
ALIKE: Final = ("process",)
ANSWERS: Final[dict[str, tuple[str, ...]]] = {
    **dict.fromkeys(("letter", "large-space"), (*ALIKE, "paper")),
    "letter-teachers": ("paper",),
    "ladder": (*ALIKE, "linear"),
    **dict.fromkeys(("forward-model", "planar-arm-7", "planar-arm-50"), (*ALIKE, "model-alone")),
    **dict.fromkeys(("settings", "proved-model"), (*ALIKE, "model")),
    "learning": (*ALIKE, "linear", "nearest", "model"),
    "suite": (*ALIKE, "linear", "nearest"),
}
# The second table, beside results.csv, that gets rows from the runs of an experiment.
SMALL_TABLES: Final = {"asking": "asked.csv", **dict.fromkeys(("learners", "letter", "large-space"), "explored.csv")}
LARGE: Final[Variant] = {"environment.task_space": 100.0}
BASELINE: Final[Variant] = {"goals": "uniform", "inverse": "nearest", "search": "perturb"}  # standard baseline
SCHOOL: Final = ("map-elites", "isoline", "cma-me", "cma-mae")  # algorithms of quality diversity
SHORT: Final[Variant] = {"movements": 2000, "evaluate_at": (250, 500, 1000)}  # a run is also evaluated at its end
# Files of demonstrations that ``make_subsets`` writes.
FEW, MANY, HALF, CORNER, SHUFFLED, TEN, HAND = MADE = tuple(
    Path(f"{name}.npz") for name in ("few", "many", "half", "corner", "shuffled", "ten", "hand")
)
# Variants of SGIM-D on the rod with and without a forward model. A name with the ending -arm-7 or -arm-50 has the same
# options on a planar arm.
MODEL: Final[Variant] = {**SGIM_D, "inverse": "model-alone"}
REFINING: Final[dict[str, Variant]] = {
    "sgim-d": SGIM_D,
    "model": MODEL,
    "gradient": {**MODEL, "search": "gradient"},
}
SWIMMER: Final[Variant] = {"environment": "swimmer", **SHORT}  # a robot of gymnasium
# Learners of the suite besides `practice`.
SUITED: Final[dict[str, Variant]] = {
    **REFERENCES,
    "practice-uniform": UNIFORM_PRACTICE,
    "cma-mae": {"algorithm": "cma-mae"},
    "map-elites": {"algorithm": "map-elites"},
}
ON_ROD: Final[Variant] = {"evaluate_at": (250, 500, 1000, 2000), "floor_at": (5000,)}
ONCE: Final[Variant] = {"teacher": "initial", "teacher.every": 1}  # at the start, one demonstration a movement
TAUGHT: Final[Variant] = {**UNIFORM_PRACTICE, "algorithm": "practice-taught", **ONCE}
# Learners on the rod: the suite's learners, and rivals with and without demonstrations.
LEARNING: Final[dict[str, Variant]] = {
    f"{name}.rod": {**line, **ON_ROD}
    for name, line in {
        **SUITED,
        "practice-taught": TAUGHT,
        "practice-corner": {**TAUGHT, "demonstrations": CORNER},
        "practice-shuffled": {**TAUGHT, "demonstrations": SHUFFLED},
        "sagg-riac": SAGG_RIAC,
        "sgim-d": SGIM_D,
        "sgim-d-uniform": {**SGIM_D, "goals": "uniform"},
        "uniform-nearest-taught": {**SGIM_D, **BASELINE},
        "cma-mae-taught": {"algorithm": "cma-mae-taught"},
        "cma-mae-taught-once": {"algorithm": "cma-mae-taught", "imitations": 1, **ONCE},
        "map-elites-taught": {"algorithm": "map-elites-taught"},
        "imitation": {"algorithm": "imitation", "inverse": "model"},
    }.items()
}
# Steps from the standard baseline to `practice` that are not in LEARNING, and learners with another teaching schedule.
MIDDLE: Final[Variant] = {**REFERENCES[UNIFORM], "explore": "widening", "global_range": (0.02, 0.3)}
BEGUN: Final[dict[str, Variant]] = {"middle": MIDDLE, "middle-process": {**MIDDLE, "inverse": "process"}}
STEPS_OF_GAIN: Final[dict[str, Variant]] = {
    **BEGUN,
    "middle-random": {**MIDDLE, "inverse": "process", "global_range": (1.0, 1.0)},
    "middle-map-elites": {"algorithm": "experiments.parts:map_elites_middle"},
    "home-babbling": {"algorithm": "experiments.home_babbling:home_babbling"},
    "practice-interest": {**UNIFORM_PRACTICE, "goals": "interest-map"},
}
SCHEDULES: Final[dict[str, Variant]] = {
    "practice-taught-every-30": {**TAUGHT, "teacher": "periodic", "teacher.every": 30, "social.repeats": 10},
    "sgim-d-once": {**SGIM_D, **ONCE, "social.repeats": 1},
    "uniform-nearest-taught-once": {**SGIM_D, **BASELINE, **ONCE, "social.repeats": 1},
    "map-elites-taught-once": {"algorithm": "map-elites-taught", "imitations": 1, **ONCE},
}
# Options of a short run in which ten lessons come early, as a person would give them.
SESSION: Final[Variant] = {"movements": 1000, "evaluate_at": (300, 500)}  # a run is also evaluated at its end
SHOWN: Final[dict[str, Variant]] = {"goals": {**SGIM_D, "teacher": "initial"}, "practice": TAUGHT}
LONGER: Final[Variant] = {"inverse.rate": 2.0}  # more training, because movements of a planar arm take no time

# Learners that ask.
IM: Final[Variant] = {"algorithm": "sgim-im"}
ACTS: Final[Variant] = {"algorithm": "sgim-acts"}
FOUR: Final = ("demonstrator-1", "demonstrator-2", "demonstrator-3", "mislabelling")
HALVES: Final = ("low-half", "high-half")
TOSS: Final[Variant] = {"environment": "toss", **SHORT}
ASKING: Final[dict[str, Variant]] = {
    "taught-every-30": SGIM_D,
    "taught-at-start": {**SGIM_D, "teacher": "initial"},
    "taught-at-start-once": TAUGHT,
    "alone": UNIFORM_PRACTICE,
    "sgim-im": IM,
    "sgim-im-83": {**IM, "demonstrations": MANY},
    "sgim-im-cost-10": {**IM, "cost": 10.0},
    "sgim-im-search": {"algorithm": "sgim-im-search"},
    **{f"sgim-acts-{number}": {**ACTS, "teachers": (f"demonstrator-{number}",)} for number in (1, 2, 3)},
    "sgim-acts-four": {**ACTS, "teachers": FOUR},
    "sgim-acts-four-search": {"algorithm": "sgim-acts-search", "teachers": FOUR},
    "sgim-acts-halves": {**ACTS, "teachers": HALVES},
    "sgim-eer": {"algorithm": "sgim-eer"},
    "alone-toss": {**UNIFORM_PRACTICE, **TOSS},
    "alone-toss-blind": {**UNIFORM_PRACTICE, **TOSS, "environment": "experiments.parts:blind_toss"},
    "sgim-im-toss": {**IM, **TOSS},
}

# Settings on which no default was tuned, each with its changed options. A variant is named like sgim-d@noise-twice.
ROBOTS: Final[dict[str, Variant]] = {
    "as-it-is": {},
    "noise-none": {"environment.noise": 0.0},
    "noise-twice": {"environment.noise": 0.064},
    "longer-line": {"environment": "rod-long"},
    "swimmer": {"environment": "swimmer"},
}
TEACHERS: Final[dict[str, Variant]] = {
    "13-shown": {"demonstrations": FEW},
    "one-corner": {"demonstrations": CORNER},
    "shuffled": {"demonstrations": SHUFFLED},
}
PRACTICE: Final[Variant] = {"algorithm": "practice"}
PROVED_MODEL: Final[Variant] = {"inverse": "model"}  # the model answers once it predicts as well as `process`
BY_PROOF: Final[Variant] = {**SGIM_D, **PROVED_MODEL, "search": "gradient"}
UNTAUGHT: Final[dict[str, Variant]] = {
    "random": {"algorithm": "random"},
    "uniform": {**SAGG_RIAC, **BASELINE},
    "sagg-riac": SAGG_RIAC,
    "sagg-riac-uniform": {**SAGG_RIAC, "goals": "uniform"},
    "sagg-riac-model": {**SAGG_RIAC, **PROVED_MODEL},
    "practice": UNIFORM_PRACTICE,
}
TAUGHT_ALIKE: Final[dict[str, Variant]] = {
    "uniform-taught": {**SGIM_D, **BASELINE},
    "sgim-d": SGIM_D,
    "sgim-d-uniform": {**SGIM_D, "goals": "uniform"},
    "sgim-d-model": {**SGIM_D, **PROVED_MODEL},
    "practice-taught": TAUGHT,
}
EVERYWHERE: Final[Variant] = {"movements": 2000, "evaluate_at": (500,)}


def _of_teacher(teacher: int, ending: str = "") -> dict[str, Variant]:
    """Learners taught by demonstrator 1 or 2; with the ending "-letter" they learn by the letter of the paper."""
    letter = {"sgim-d": LETTER, "imitation": INVERSE, "observation": INVERSE}
    return {
        f"{algorithm}{ending}-teacher-{teacher}": {
            "algorithm": algorithm,
            "demonstrations": SHIPPED.with_name(f"demonstrator_{teacher}.npz"),
            **(options if ending else {}),
        }
        for algorithm, options in letter.items()
    }


def _on_arm(arm: str) -> dict[str, Variant]:
    short = arm.removeprefix("planar-")
    return {
        f"{name}-{short}": {
            **(LONGER if "inverse" in line else {}),
            **line,
            "environment": arm,
            **SHORT,
        }
        for name, line in REFINING.items()
    }


def _on_suite(learners: dict[str, Variant], tasks: Iterable[str] = SUITE) -> dict[str, Variant]:
    """Each learner on all tasks, except the rod (its runs are longer) and the toss if the learner takes no context."""
    return {
        f"{name}.{task}": {**line, **TASKS[task].options, **SHORT}
        for task in tasks
        for name, line in learners.items()
        if task != "rod" and not (name in SCHOOL and task == "toss")
    }


def _ladder(ending: str, where: Variant) -> dict[str, Variant]:
    """The steps between the letter of the paper, ``sgim-d-letter``, and our defaults, ``sgim-d``."""
    found, line = {}, {**SGIM_D, **LETTER, **where}
    for number, (step, _, becomes) in enumerate(STEPS[:-1], 1):
        found[f"ladder-{number}-{step}{ending}"] = line = {**line, **becomes}
    return found


EXPERIMENTS: Final[dict[str, dict[str, Variant]]] = {
    "learners": {name: {"algorithm": name} for name in ("random", "sagg-riac", "observation", "imitation", "sgim-d")},
    "teachers": {**_of_teacher(1), **_of_teacher(2)},
    "large-space": {
        "sagg-riac-large": {**SAGG_RIAC, **LARGE},
        "sgim-d-large": {**SGIM_D, **LARGE},
        "sgim-d-uniform-large": {**SGIM_D, **LARGE, "goals": "uniform"},
        "sgim-d-absolute-large": {**SGIM_D, **LARGE, "goals.progress": "absolute"},
        "random-goals-demonstrations-large": {**SGIM_D, **BASELINE, **LARGE},
        "sagg-riac-letter-large": {**SAGG_RIAC, **LETTER, **LARGE},
        "sgim-d-letter-large": {**SGIM_D, **LETTER, **LARGE},
    },
    "letter": {
        f"{algorithm}-letter": {"algorithm": algorithm, **(LETTER if algorithm in ("sagg-riac", "sgim-d") else INVERSE)}
        for algorithm in ("sagg-riac", "observation", "imitation", "sgim-d")
    },
    "letter-teachers": {**_of_teacher(1, "-letter"), **_of_teacher(2, "-letter")},
    "ladder": _ladder("", {}),
    "ladder-large": _ladder("-large", LARGE),
    "ablations": {
        "uniform-goals": {**SGIM_D, "goals": "uniform"},
        "grid": {**SGIM_D, "goals": "grid"},
        "alp-gmm": {**SGIM_D, "goals": "alp-gmm"},
        "absolute-progress": {**SGIM_D, "goals.progress": "absolute"},
        "paired-progress": {**SGIM_D, "goals.progress": "paired"},
        "attempt-competence": {**SGIM_D, "goals.progress": "absolute", "judge": "attempt"},
        "search-nelder-mead-exact": {**SGIM_D, **EXACT},
        "search-perturb": {**SGIM_D, "search": "perturb"},
        "search-cma-es": {**SGIM_D, "search": "cma-es"},
    },
    "baselines": {  # baselines that are not in LEARNING
        "demonstrations-noise": {"algorithm": "imitation", "teacher.choose": "random"},
        **{name: {"algorithm": name} for name in ("isoline", "cma-me")},
        **{f"{name}-demonstrations": {"algorithm": f"{name}-taught"} for name in ("isoline", "cma-me")},
        # Rivals with tuned settings: better than the defaults in a search on other seeds, see results/RIVALS.md.
        "map-elites-tuned": {"algorithm": "map-elites", "cells": 10},
        "cma-me-tuned": {"algorithm": "cma-me", "sd": 0.05},
        "cma-mae-demonstrations-tuned": {"algorithm": "cma-mae-taught", "sd": 0.05},
    },
    "teaching": {
        "every-10": {**SGIM_D, "teacher.every": 10},
        "every-100": {**SGIM_D, "teacher.every": 100},
        "initial": {**SGIM_D, "teacher": "initial"},
        "asked": {**SGIM_D, "teacher": "asked"},
        "few-demonstrations": {**SGIM_D, "demonstrations": FEW},
        "half-plane": {**SGIM_D, "demonstrations": HALF},
    },
    "asking": ASKING,
    "forward-model": REFINING,
    **{arm: _on_arm(arm) for arm in ARMS},
    "swimmer": {
        **{f"{name}-swimmer": {"algorithm": name, "inverse": "linear", **SWIMMER} for name in SWIMMERS},
        "practice-swimmer": {**UNIFORM_PRACTICE, **SWIMMER},
    },
    "by-hand": {
        "goals-alone": {**SAGG_RIAC, **SESSION},
        "practice-alone": {**UNIFORM_PRACTICE, **SESSION},
        **{f"{name}-by-hand": {**line, **SESSION, "demonstrations": HAND} for name, line in SHOWN.items()},
        **{f"{name}-ten-shipped": {**line, **SESSION, "demonstrations": TEN} for name, line in SHOWN.items()},
    },
    "settings": {
        f"{name}@{setting}": {**line, **change, **EVERYWHERE}
        for setting, change in {**ROBOTS, **TEACHERS}.items()
        for name, line in {**(UNTAUGHT if setting in ROBOTS else {}), **TAUGHT_ALIKE}.items()
    },
    "learning": LEARNING,
    "suite": _on_suite(SUITED),
    "practice": {
        "practice.rod": {**PRACTICE, **ON_ROD},
        **_on_suite({"practice": PRACTICE}),
    },
    "sparse": _on_suite({"practice": PRACTICE, **REFERENCES, "sagg-riac": SAGG_RIAC}, SPARSE),
    "proved-model": {"sgim-d-model.rod": {**BY_PROOF, **ON_ROD}, **_on_suite({"sgim-d-model": BY_PROOF}, ARMS)},
    "gain": {
        **{f"{name}.rod": {**line, **ON_ROD} for name, line in {**STEPS_OF_GAIN, **SCHEDULES}.items()},
        **_on_suite(BEGUN),
    },
}


# Seeds of each page. They were first used after the defaults had been frozen.
SEEDS: Final[dict[str, range]] = {
    **dict.fromkeys(("learners", "large-space", "letter", "ladder", "ladder-large", "baselines"), range(100, 120)),
    **dict.fromkeys(("teachers", "letter-teachers", "ablations", "teaching"), range(100, 110)),
    **dict.fromkeys(("forward-model", *ARMS, "swimmer"), range(100, 110)),
    "settings": range(100, 105),
    **dict.fromkeys(("learning", "suite", "gain"), range(120, 140)),
    "sparse": range(160, 180),
    "practice": range(220, 240),
    "proved-model": range(180, 200),
    "asking": range(140, 160),
    "by-hand": range(150, 160),
}


def seeds_of(experiment: str, variant: str) -> range:
    """The seeds of a variant on its page."""
    return SEEDS["learners" if (experiment, variant) == ("forward-model", "sgim-d") else experiment]


def make_subsets(folder: Path, *, by_hand: bool = False) -> None:
    """Write subsets of the shipped demonstrations; if ``by_hand``, write ten lessons by hand, too.

    The subsets are the first 13, 83 and 10 of 127 demonstrations, those in the right half of the plane, the 20 nearest
    to one corner, and all demonstrations with permuted outcomes, as a teacher who mislabels them would show.

    Raises:
        OSError: a file cannot be written.
    """
    everything = load_demonstrations()
    outcomes = np.array([each.outcome for each in everything])
    right = [each for each in everything if each.outcome[0] > 0]
    corner = [everything[k] for k in np.linalg.norm(outcomes - outcomes.max(axis=0), axis=1).argsort()[:20]]
    dealt = stream(0, "shuffled").permutation(outcomes)
    shuffled = [replace(each, outcome=outcome) for each, outcome in zip(everything, dealt, strict=True)]
    make_folder(folder)
    # The shipped demonstrations are ordered so that the first ones already spread over the plane.
    first = ((FEW, everything[:13]), (MANY, everything[:83]), (TEN, everything[:10]))
    for name, chosen in (*first, (HALF, right), (CORNER, corner), (SHUFFLED, shuffled)):
        save_demonstrations(folder / name, chosen)
    if by_hand:
        from hand import lessons_of_a_script  # imported here, as MuJoCo loads slowly

        save_demonstrations(folder / HAND, [lesson.demonstration for lesson in lessons_of_a_script()])
