"""Every experiment as data: its variants, each a line with the differences from the defaults of ``sgimd run``.

Section 6 of Nguyen & Oudeyer (2014) first, then what the paper lacks. A variant of SGIM-D changes one option.
    EXPERIMENTS["ablations"]["uniform-goals"]        # {"algorithm": "sgim-d", "goals": "uniform"}
A variant in two experiments has the same line in both; it is run once, and has its rows in both tables.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

from sgimd_torch.demonstrations import SHIPPED, load_demonstrations, save_demonstrations
from sgimd_torch.files import make_folder
from sgimd_torch.runs.config import Config
from sgimd_torch.spaces import Demonstration

Variant = dict[str, Any]
ARMS: Final = ("planar-arm-7", "planar-arm-50")
SWIMMERS: Final = ("random", "sagg-riac", "sgim-d")
SGIM_D: Final[Variant] = {"algorithm": "sgim-d"}
SAGG_RIAC: Final[Variant] = {"algorithm": "sagg-riac"}
# From the paper to our defaults, one change at a time: what each step is called, what it was and what it becomes. The
# paper gives no number for the budget and for g_max: 60 movements are more than come between two demonstrations.
STEPS: Final[tuple[tuple[str, Variant, Variant], ...]] = (
    ("inverse", {"inverse": "paper"}, {"inverse": "linear"}),
    ("simplex", {"search": "nelder-mead-complete", "budget": 60}, {"search": "nelder-mead-exact", "budget": 15}),
    ("noise", {}, {"search": "nelder-mead"}),
    ("progress", {"progress": "absolute"}, {"progress": "gained"}),
    ("giving-up", {"give_up": -1.0}, {"give_up": -0.5}),
    ("regions", {"g_max": 50, "max_aspect": 1e9}, {"g_max": 30, "max_aspect": 5.0}),  # the last one: our defaults
)
LETTER: Final[Variant] = {option: value for _, was, _ in STEPS for option, value in was.items()}
INVERSE: Final[Variant] = {"inverse": "paper"}  # all that the letter changes in a learner without goals
LARGE: Final[Variant] = {"task_space": 100.0}
BASELINE: Final[Variant] = {"goals": "uniform", "inverse": "nearest", "search": "perturb"}  # the field's standard one
SCHOOL: Final = ("map-elites", "isoline", "isoline-again", "cma-me", "cma-mae")  # quality diversity
FEW, HALF, TEN, HAND = "few.npz", "half.npz", "ten.npz", "hand.npz"  # files that ``make_files`` makes
MADE: Final = tuple(map(Path, (FEW, HALF, TEN, HAND)))
# Ways to refine a movement for a goal, and to answer in evaluations. Each line is a variant on the rod and, with a
# longer name, on every arm.
MODEL: Final[Variant] = {**SGIM_D, "inverse": "model"}
GRADIENT: Final[Variant] = {**MODEL, "search": "gradient"}
ALONE: Final[Variant] = {**SAGG_RIAC, "inverse": "model"}
REFINING: Final[dict[str, Variant]] = {
    "sgim-d": SGIM_D,
    "sagg-riac": SAGG_RIAC,
    "sgim-d-perturb": {**SGIM_D, "search": "perturb"},
    "sagg-riac-perturb": {**SAGG_RIAC, "search": "perturb"},
    "model": MODEL,
    "gradient": GRADIENT,
    "gauss-newton": {**MODEL, "search": "gauss-newton"},
    "screened": {**MODEL, "search": "screened"},
    "polished": {**MODEL, "search": "nelder-mead-polished"},
    "sagg-riac-model": ALONE,
    "sagg-riac-gradient": {**ALONE, "search": "gradient"},
    "sagg-riac-gauss-newton": {**ALONE, "search": "gauss-newton"},
    "sagg-riac-screened": {**ALONE, "search": "screened"},
    "sagg-riac-polished": {**ALONE, "search": "nelder-mead-polished"},
    "imitation": {"algorithm": "imitation"},
    "imitation-model": {"algorithm": "imitation", "inverse": "model"},
    "gradient-linear": {**GRADIENT, "inverse": "linear"},
    "model-unanchored": {**MODEL, "anchored": False},
    "gradient-unanchored": {**GRADIENT, "anchored": False},
    "gradient-no-residual": {**GRADIENT, "residual": False},
    "model-one-noise": {**MODEL, "noise_heads": False},
    "model-1": {**MODEL, "members": 1},
    "model-5": {**MODEL, "members": 5},
}
# A robot that nobody here wrote. Evaluated by every answer, so that one run serves learners with and without a model.
SWIMMER: Final[Variant] = {
    "environment": "swimmer",
    "movements": 2000,
    "evaluate_at": (250, 500, 1000),
}  # and at the end
# Ten lessons, as a person gives them in a session: all of them early, in a short life.
SHORT: Final[Variant] = {"inverse": "process", "movements": 1000, "evaluate_at": (300, 500)}  # and at the end
TAUGHT: Final[dict[str, Variant]] = {
    "goals": {**SGIM_D, **SHORT, "teacher": "initial"},
    "practice": {"algorithm": "practice-taught", **SHORT, "teacher": "initial", "every": 1},
}
# Movements of an arm take no time, so training may take more.
ON_ARMS: Final[Variant] = {"movements": 2000, "evaluate_at": (250, 500, 1000, 1500)}  # and at the end
LONGER: Final[Variant] = {"training": 2.0}


def shipped(teacher: int) -> Path:
    """The demonstrations of demonstrator 1, 2 or 3 of section 5.3."""
    return SHIPPED.with_name(f"demonstrator_{teacher}.npz")


def _of_teacher(teacher: int) -> dict[str, Variant]:
    taught = ("sgim-d", "imitation", "observation")
    return {
        f"{algorithm}-teacher-{teacher}": {"algorithm": algorithm, "demonstrations": shipped(teacher)}
        for algorithm in taught
    }


def _on_arm(arm: str) -> dict[str, Variant]:
    short = arm.removeprefix("planar-")
    return {
        f"{name}-{short}": {**(LONGER if Config(**line).uses_model else {}), **line, "environment": arm, **ON_ARMS}
        for name, line in REFINING.items()
    }


def _ladder(ending: str, where: Variant) -> dict[str, Variant]:
    """SGIM-D between the letter, ``sgim-d-letter``, and our defaults, ``sgim-d``, which the last step leads to."""
    found, line = {}, {**SGIM_D, **LETTER, **where}
    for number, (step, _, becomes) in enumerate(STEPS[:-1], 1):
        found[f"ladder-{number}-{step}{ending}"] = line = {**line, **becomes}
    return found


def ladder(ending: str = "") -> list[str]:
    """The names of its variants, from the letter to our defaults; ``ending`` "-large" for those in the large space."""
    return [f"sgim-d-letter{ending}", *EXPERIMENTS[f"ladder{ending}"], f"sgim-d{ending}"]


EXPERIMENTS: Final[dict[str, dict[str, Variant]]] = {
    "learners": {name: {"algorithm": name} for name in ("random", "sagg-riac", "observation", "imitation", "sgim-d")},
    "teachers": {**_of_teacher(1), **_of_teacher(2)},
    "large-space": {
        "sagg-riac-large": {**SAGG_RIAC, **LARGE},
        "sgim-d-large": {**SGIM_D, **LARGE},
        "sgim-d-uniform-large": {**SGIM_D, **LARGE, "goals": "uniform"},
        "random-goals-demonstrations-large": {**SGIM_D, **BASELINE, **LARGE},
        "cma-mae-large": {"algorithm": "cma-mae", **LARGE},
        "sagg-riac-letter-large": {**SAGG_RIAC, **LETTER, **LARGE},
        "sgim-d-letter-large": {**SGIM_D, **LETTER, **LARGE},
    },
    "long": {"sgim-d-long": {**SGIM_D, "movements": 10_000}},
    "letter": {
        f"{algorithm}-letter": {"algorithm": algorithm, **(LETTER if algorithm in ("sagg-riac", "sgim-d") else INVERSE)}
        for algorithm in ("sagg-riac", "observation", "imitation", "sgim-d")
    },
    "ladder": _ladder("", {}),
    "ladder-large": _ladder("-large", LARGE),
    "ablations": {
        "uniform-goals": {**SGIM_D, "goals": "uniform"},
        "grid": {**SGIM_D, "goals": "grid"},
        "alp-gmm": {**SGIM_D, "goals": "alp-gmm"},
        "absolute-progress": {**SGIM_D, "progress": "absolute"},
        "paired-progress": {**SGIM_D, "progress": "paired"},
        "attempt-competence": {**SGIM_D, "progress": "absolute", "competence": "attempt"},
        "inverse-paper": {**SGIM_D, "inverse": "paper"},
        "inverse-nearest": {**SGIM_D, "inverse": "nearest"},
        "search-nelder-mead-exact": {**SGIM_D, "search": "nelder-mead-exact"},
        "search-perturb": {**SGIM_D, "search": "perturb"},
        "search-cma-es": {**SGIM_D, "search": "cma-es"},
    },
    "baselines": {
        "random-goals": {**SAGG_RIAC, **BASELINE},
        "random-goals-demonstrations": {**SGIM_D, **BASELINE},
        "demonstrations-noise": {"algorithm": "imitation", "choice": "random"},
        **{name: {"algorithm": name} for name in SCHOOL},
        **{f"{name}-demonstrations": {"algorithm": f"{name}-taught"} for name in SCHOOL},
    },
    "teaching": {
        "every-10": {**SGIM_D, "every": 10},
        "every-100": {**SGIM_D, "every": 100},
        "initial": {**SGIM_D, "teacher": "initial"},
        "asked": {**SGIM_D, "teacher": "asked"},
        "few-demonstrations": {**SGIM_D, "demonstrations": Path(FEW)},
        "half-plane": {**SGIM_D, "demonstrations": Path(HALF)},
    },
    "forward-model": REFINING,
    **{arm: _on_arm(arm) for arm in ARMS},
    "swimmer": {
        **{f"{name}-swimmer": {"algorithm": name, "inverse": "model", **SWIMMER} for name in SWIMMERS},
        "practice-swimmer": {"algorithm": "practice", **SWIMMER},
    },
    "by-hand": {
        "goals-alone": {**SAGG_RIAC, **SHORT},
        "practice-alone": {"algorithm": "practice", **SHORT},
        **{f"{name}-by-hand": {**line, "demonstrations": Path(HAND)} for name, line in TAUGHT.items()},
        **{f"{name}-ten-shipped": {**line, "demonstrations": Path(TEN)} for name, line in TAUGHT.items()},
    },
}


def tables_of(experiment: str) -> list[str]:
    """The tables of results that its runs write rows to; the first has their evaluations."""
    if experiment in ("forward-model", *ARMS):
        return ["forward_model.csv"]
    if experiment in ("swimmer", "by-hand"):
        return ["gymnasium.csv" if experiment == "swimmer" else "by_hand.csv"]
    return ["paper.csv", *(["goals.csv"] if experiment in ("large-space", "ladder-large") else [])]


def make_files(wanted: Iterable[Path | None]) -> None:
    """Write those of the ``wanted`` files of demonstrations that ``MADE`` names.

    They are a few of the shipped ones, 13 of 127, those in the right half of the plane, ten, and ten led by hand.

    Raises:
        RunError, OSError: one cannot be written.
    """
    for path in {path for path in wanted if path is not None and Path(path.name) in MADE}:
        make_folder(path.parent)
        save_demonstrations(path, _made(path.name))


def _made(name: str) -> list[Demonstration]:
    if name == HAND:
        from by_hand import lessons_of_a_script  # MuJoCo is loaded only when it is needed

        return [lesson.demonstration for lesson in lessons_of_a_script()]
    everything = load_demonstrations()  # they are ordered so that the first ones are spread
    right = [demonstration for demonstration in everything if demonstration.outcome[0] > 0]
    return {FEW: everything[:13], HALF: right, TEN: everything[:10]}[name]


def teacher_of(config: Config) -> str:
    """Who demonstrates: the number of the demonstrator, the file's name, or "structured" for the postures that an arm
    is shown; "" for a learner without a teacher."""
    if "teacher" not in config.used:
        return ""
    if config.environment in ARMS and config.demonstrations is None:
        return "structured"
    return (config.demonstrations or SHIPPED).stem.removeprefix("demonstrator_")
