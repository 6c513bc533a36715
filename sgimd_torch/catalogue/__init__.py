"""The table of words: all that the command line can name, and where it is.

    load_word("goals", "grid")                    # ProgressGrid; imported now
    load_word("goals", "mypackage.goals:Curious") # of your own
Whoever leaves a feature out deletes its folder and its lines of this table. A description is the first line of the
docstring at the place, options are its signature (`sgimd_torch.catalogue.options`); nothing here repeats them.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import os
import sys
from collections.abc import Callable, Collection, Iterable
from difflib import get_close_matches
from functools import cache, partial
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

ROD: Final = "fishing-rod"
WORDS: Final[dict[str, dict[str, str]]] = {
    "algorithm": {
        "random": "algorithms.paper:random_exploration",
        "sagg-riac": "algorithms.paper:sagg_riac",
        "practice": "algorithms.practice:practice",
        "practice-taught": "algorithms.practice:practice_taught",
        "observation": "algorithms.paper:observation",
        "imitation": "algorithms.paper:imitation",
        "sgim-d": "algorithms.paper:sgim_d",
        "sgim-im": "asking.algorithms:sgim_im",
        "sgim-im-search": "asking.algorithms:sgim_im_search",
        "sgim-acts": "asking.algorithms:sgim_acts",
        "sgim-acts-search": "asking.algorithms:sgim_acts_search",
        "sgim-eer": "asking.algorithms:sgim_eer",
        "map-elites": "rivals.quality_diversity:map_elites_alone",
        "map-elites-taught": "rivals.quality_diversity:map_elites",
        "isoline": "rivals.quality_diversity:isoline_alone",
        "isoline-taught": "rivals.quality_diversity:isoline",
        "cma-me": "rivals.quality_diversity:cma_me_alone",
        "cma-me-taught": "rivals.quality_diversity:cma_me",
        "cma-mae": "rivals.quality_diversity:cma_mae_alone",
        "cma-mae-taught": "rivals.quality_diversity:cma_mae",
    },
    "environment": {
        ROD: "runs.tasks.rods:fishing_rod",
        "rod-wind": "runs.tasks.rods:rod_wind",
        "rod-long": "runs.tasks.rods:rod_long",
        "planar-arm-7": "runs.tasks.robots:planar_arm_7",
        "planar-arm-50": "runs.tasks.robots:planar_arm_50",
        "swimmer": "runs.tasks.robots:swimmer",
        "half-reached": "runs.tasks.robots:half_reached",
        "toss": "runs.tasks.toys:toss",
        "crawler": "runs.tasks.toys:crawler",
        "two-elbows": "runs.tasks.toys:two_elbows",
        "spatial-arm": "runs.tasks.toys:spatial_arm",
        "puck": "runs.tasks.toys:puck",
        "fetch": "runs.tasks.toys:fetch",
    },
    "goals": {
        "interest-map": "goals.interest_map:InterestMap",
        "grid": "goals.progress_grid:ProgressGrid",
        "alp-gmm": "rivals.alp_gmm:AlpGmm",
        "uniform": "goals.uniform:UniformGoals",
        "within-reach": "goals.within_reach:WithinReach",
        "strategic": "asking.interest:StrategicInterest",
        "entropy": "asking.entropy:EntropyGoals",
    },
    "progress": {
        "gained": "goals.regions:gained_progress",
        "absolute": "goals.regions:absolute_progress",
        "paired": "goals.regions:paired_progress",
    },
    "search": {
        "nelder-mead": "searches.simplex:NelderMead",
        "nelder-mead-exact": "searches.simplex:exact",
        "nelder-mead-complete": "searches.simplex:complete",
        "perturb": "searches.perturb:Perturb",
        "vary": "searches.perturb:Vary",
        "cma-es": "rivals.cma_es:CmaEs",
        "gradient": "forward_model.search:GradientSearch",
    },
    "explore": {
        "anywhere": "explore.anywhere:Anywhere",
        "widening": "explore.widening:Widening",
        "returning": "explore.returning:Returning",
    },
    "inverse": {
        "linear": "inverses.locally_linear:LocallyLinear",
        "paper": "inverses.local:LocalInverse",
        "nearest": "inverses.nearest:NearestNeighbour",
        "process": "inverses.local_process:LocalProcess",
        "among-effects": "inverses.among_effects:AmongEffects",
        "model": "forward_model.proved:ProvedModel",
        "model-alone": "forward_model.inverse:ModelAlone",
    },
    "judge": {
        "memory": "competence:Competence",
        "attempt": "competence:AttemptCompetence",
    },
    "social": {
        "imitate": "strategies:Imitate",
        "emulate": "strategies:Emulate",
    },
    "teacher": {
        "periodic": "teachers:PeriodicTeacher",
        "initial": "teachers:InitialTeacher",
        "at-once": "teachers:at_once",
        "asked": "teachers:AskedTeacher",
        "by-hand": "teach.by_hand:ByHand",
    },
    "choose": {
        "least-explored": "teachers:least_explored",
        "random": "teachers:at_random",
    },
    "teachers": {
        "all": "asking.teachers:AnsweringTeacher",
        "demonstrator-1": "asking.teachers:demonstrator_1",
        "demonstrator-2": "asking.teachers:demonstrator_2",
        "demonstrator-3": "asking.teachers:demonstrator_3",
        "low-half": "asking.teachers:low_half_teacher",
        "high-half": "asking.teachers:high_half_teacher",
        "mislabelling": "asking.teachers:mislabelling",
        "slow": "asking.teachers:slow",
    },
    "command": {
        "run": "runs.command_line",
        "sweep": "runs.sweep",
        "check": "views.check",
        "demonstrations": "views.demonstrations",
        "suite": "views.suite",
        "benchmark": "views.benchmark",
        "table": "views.table",
        "report": "views.report.command",
        "teach": "teach.command",
        "film": "views.film.command",
        "demo": "views.demo",
    },
}
# Who shows an algorithm something, unless a run says otherwise; "teachers" are asked. Others learn alone.
TAUGHT_BY: Final = {
    **dict.fromkeys(("observation", "imitation", "sgim-d"), "periodic"),
    **dict.fromkeys((word for word in WORDS["algorithm"] if word.endswith("-taught")), "periodic"),
    "practice-taught": "at-once",
    **dict.fromkeys((word for word, at in WORDS["algorithm"].items() if at.startswith("asking.")), "teachers"),
}
# Extras that bring what a command imports.
EXTRAS: Final = {
    **dict.fromkeys(("demonstrations", "suite", "demo"), "plot"),
    **{name: name for name in ("report", "teach", "film")},
}
_PACKAGE: Final = Path(__file__).parents[1]


def place_of(kind: str, word: str) -> str:
    """Place of what ``word`` names, ``package.module:attribute``.

    Raises:
        ValueError: it is neither in the table nor such a place.
    """
    if word in WORDS[kind]:
        return f"{_PACKAGE.name}.{WORDS[kind][word]}"
    if ":" not in word:
        raise unknown(kind, word, WORDS[kind], _meant(word))
    return word


def load_word(kind: str, word: str) -> Callable[..., Any]:
    """The thing that ``word`` names.

    Raises:
        ValueError: it is not in the table, cannot be loaded or cannot be called.
    """
    made: Callable[..., Any] = load(place_of(kind, word), f"{kind} {word}" if ":" in word else "")
    if not callable(made):
        raise ValueError(f"{kind} {word} must be something to call, but it is a {type(made).__name__}")
    return made


@cache
def about(kind: str, word: str) -> str:
    """First line of the docstring of what ``word`` of the table names, which is not imported for that."""
    module, _, name = WORDS[kind][word].partition(":")
    path = _PACKAGE / module.replace(".", "/")
    tree = ast.parse((path / "__init__.py" if path.is_dir() else path.with_suffix(".py")).read_text(encoding="utf-8"))
    found = ast.get_docstring(tree) if not name else None
    for node, after in pairwise((*tree.body, ast.Pass())):
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == name:
            found = ast.get_docstring(node)
        elif isinstance(node, ast.Assign) and isinstance(after, ast.Expr) and ast.unparse(node.targets[0]) == name:
            found = ast.literal_eval(after.value)
    return (found or "").partition("\n")[0].rstrip(".")


def named(made: Callable[..., Any]) -> tuple[str, str] | None:
    """Kind and word of what the table names; None for anything else."""
    place = f"{function_of(made).__module__}:{function_of(made).__qualname__}"
    places = ((kind, word, f"{_PACKAGE.name}.{at}") for kind, words in WORDS.items() for word, at in words.items())
    return next(((kind, word) for kind, word, at in places if at == place), None)


def function_of(made: Callable[..., Any]) -> Callable[..., Any]:
    """The function or class itself, without what is fixed."""
    return function_of(made.func) if isinstance(made, partial) else made


def called(what: str, make: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
    """Result of a call of ``make``; a thing of a user's own may not be callable as others of its kind are.

    Raises:
        ValueError: it takes other arguments, or would end the program.
    """
    try:
        inspect.signature(make).bind(*arguments, **options)
    except TypeError as error:
        raise ValueError(f"{what} cannot be called as others of its kind are: {error}") from error
    try:
        return make(*arguments, **options)
    except SystemExit as end:  # it must not end the command, which would look like success
        raise ValueError(f"{what} cannot be made: it calls exit({end})") from end


def load(place: str, what: str = "") -> Any:
    """The attribute at ``package.module:attribute``; packages of the working directory are found, too.

    Raises:
        ValueError: no such module or attribute, or the module cannot be imported; its own error is shown.
    """
    module, _, attribute = place.partition(":")
    what = what or place
    if module.endswith(".py"):
        raise ValueError(
            f"{what}: a module is named without .py and with dots: {module[:-3].replace('/', '.')}:{attribute}"
        )
    here = os.getcwd()
    if here not in sys.path:
        sys.path.append(here)
    try:
        found: Any = importlib.import_module(module)
    except (Exception, SystemExit) as error:  # whatever that module does when it is imported
        if isinstance(error, ImportError) and module.startswith(_PACKAGE.name):
            brings_torch = "; pip install 'sgimd-torch[forward]' brings it" if error.name == "torch" else ""
            raise ValueError(f"{error}{brings_torch}") from error  # what needs another extra names it itself
        where = f"; is it installed, or in {here}?" if isinstance(error, ImportError) else ""
        raise ValueError(
            f"{what}: the module {module} cannot be imported: {type(error).__name__}: {error}{where}"
        ) from error
    for name in attribute.split("."):
        if not hasattr(found, name):
            public = [each for each in dir(found) if not each.startswith("_")]
            raise ValueError(f"{what}: {module} has no {attribute}{did_you_mean(name, public, 3)}")
        found = getattr(found, name)
    return found


def unknown(what: str, word: str, known: Collection[str], also: str = "") -> ValueError:
    """The error for a ``word`` that is none of those ``known``: the nearest first, then all, then ``also``."""
    near = did_you_mean(word, known)
    return ValueError(f"unknown {what} {word!r}{f'{near} Known' if near else '; known'} are {', '.join(known)}{also}")


def did_you_mean(name: str, known: Iterable[str], most: int = 1) -> str:
    """``; did you mean grid?``, with the ``most`` names that are near; nothing where no known name is."""
    spelt = {each.lower().replace("_", "-"): each for each in known}
    near = get_close_matches(name.lower().replace("_", "-"), spelt, most, 0.5)
    return f"; did you mean {' or '.join(spelt[each] for each in near)}?" if near else ""


def _meant(word: str) -> str:
    """What an unknown ``word`` was probably meant to be."""
    module, dot, name = word.rpartition(".")
    if name in ("xml", "urdf"):
        return (
            f"; {word} is a model file: write a class around it (docs/own-robot.md), and name it package.module:Class"
        )
    if os.path.isfile(f"{word.replace('.', '/')}.py"):
        return f"; {word} is a module here: name what is in it, {word}:NAME"
    return f"; is it {module}:{name}?" if dot else ", and package.module:attribute for one of your own"
