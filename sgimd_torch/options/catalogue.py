"""The catalogue: every name that the command line knows, with the place of its class, function or module.

    load_word("goals", "uniform")                 # UniformGoals, which is imported now
    load_word("goals", "mypackage.goals:Curious") # a class of your own
To remove a feature, delete its folder and its lines of this table. The help text of a name is the first line of the
docstring at its place. The options are keywords of the signature there (`sgimd_torch.options.signature`).
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
        "planar-arm-7": "runs.tasks.robots:planar_arm_7",
        "planar-arm-50": "runs.tasks.robots:planar_arm_50",
        "mujoco": "environments.mujoco_robot:MujocoRobot",
    },
    "goals": {
        "interest-map": "goals.interest_map:InterestMap",
        "alp-gmm": "rivals.alp_gmm:AlpGmm",
        "uniform": "goals.uniform:UniformGoals",
        "within-reach": "goals.within_reach:WithinReach",
        "strategic": "asking.interest:StrategicInterest",
    },
    "progress": {
        "gained": "goals.regions:gained_progress",
        "absolute": "goals.regions:absolute_progress",
    },
    "search": {
        "nelder-mead": "searches.simplex:NelderMead",
        "perturb": "searches.perturb:Perturb",
        "vary": "searches.perturb:Vary",
        "cma-es": "rivals.cma_es:CmaEs",
        "gradient": "forward_model.search:GradientSearch",
    },
    "explore": {
        "anywhere": "searches.explore:Anywhere",
        "widening": "searches.explore:Widening",
        "returning": "searches.explore:Returning",
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
    },
    "command": {
        "run": "options.command_line",
        "sweep": "runs.sweep",
        "check": "views.check",
        "demonstrations": "views.demonstrations",
        "benchmark": "views.benchmark",
        "table": "views.table",
        "report": "views.report.command",
        "teach": "teach.command",
        "film": "views.film.command",
        "ask": "views.ask",
        "demo": "views.demo",
    },
}
# Default teacher of each taught algorithm; "teachers": the algorithm asks teachers. Other algorithms learn alone.
TAUGHT_BY: Final = {
    **dict.fromkeys(("observation", "imitation", "sgim-d"), "periodic"),
    **dict.fromkeys((word for word in WORDS["algorithm"] if word.endswith("-taught")), "periodic"),
    "practice-taught": "at-once",
    **dict.fromkeys((word for word, at in WORDS["algorithm"].items() if at.startswith("asking.")), "teachers"),
}
# The extra of the package that each of these commands needs.
EXTRAS: Final = {
    **dict.fromkeys(("demonstrations", "demo"), "plot"),
    **{name: name for name in ("report", "teach", "film")},
}
_PACKAGE: Final = Path(__file__).parents[1]
PLACES: Final = {f"{_PACKAGE.name}.{at}" for words in WORDS.values() for at in words.values()}
"""Places of the catalogue. All other places are code of a user, even places in this library: from a module of ours,
dots may lead to any module that it imports."""


def place_of(kind: str, word: str) -> str:
    """Place of the class, function or module that ``word`` names, as ``package.module:attribute``.

    Raises:
        ValueError: the name is neither in the catalogue nor a place.
    """
    if word in WORDS[kind]:
        return f"{_PACKAGE.name}.{WORDS[kind][word]}"
    if ":" not in word:
        module, dot, name = word.rpartition(".")
        meant = f"is it {module}:{name}?" if dot else "or, for code of your own, package.module:attribute"
        if name in ("xml", "urdf"):
            meant = f"for a model file write --environment mujoco --environment.model {word}: docs/how-to/mujoco.md"
        raise unknown(kind, word, WORDS[kind], f"; {meant}")
    return word


def word_of(kind: str, make: Callable[..., Any]) -> str:
    """The name of a class or function, or its place if it has no name; the inverse of ``place_of``."""
    place = f"{function_of(make).__module__}:{function_of(make).__qualname__}"
    return next((word for word, at in WORDS[kind].items() if f"{_PACKAGE.name}.{at}" == place), place)


def load_word(kind: str, word: str) -> Callable[..., Any]:
    """The class or function that ``word`` names; its module is searched in the working directory, too.

    Raises:
        ValueError: there is none, its module cannot be imported, or it cannot be called; the message says why.
    """
    module, _, name = place_of(kind, word).partition(":")
    what = f"{kind} {word}"
    if module.endswith(".py"):
        raise ValueError(f"{what}: write the module without .py and with dots, {module[:-3].replace('/', '.')}:{name}")
    here = os.getcwd()
    if here not in sys.path:
        sys.path.append(here)
    try:
        found = importlib.import_module(module)
    except (Exception, SystemExit) as error:  # a user's module may raise anything
        if isinstance(error, ImportError) and word in WORDS[kind]:
            raise ValueError(str(error)) from error  # it names the extra that installs what is missing
        where = f"; is it installed, or in {here}?" if isinstance(error, ImportError) else ""
        why = f"{type(error).__name__}: {error}{where}"
        raise ValueError(f"{what}: the module {module} cannot be imported: {why}") from error
    if not hasattr(found, name):
        raise ValueError(f"{what}: {module} has no {name}{did_you_mean(name, dir(found), 3)}")
    made: Callable[..., Any] = getattr(found, name)
    if not callable(made):
        raise ValueError(f"{what} must be a class or a function, got a {type(made).__name__}")
    return made


@cache
def about(kind: str, word: str) -> str:
    """Help text of a name of the catalogue: the first line of its docstring, read without importing the module."""
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


def function_of(made: Callable[..., Any]) -> Callable[..., Any]:
    """The function or class inside of any ``partial``."""
    return function_of(made.func) if isinstance(made, partial) else made


def call_checked(what: str, make: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
    """Result of a call of ``make``, which may be code of a user.

    Raises:
        ValueError: ``make`` takes other arguments, or it ends the program.
    """
    try:
        inspect.signature(make).bind(*arguments, **options)
    except TypeError as error:
        raise ValueError(f"{what} cannot be called with the arguments of its kind: {error}") from error
    try:
        return make(*arguments, **options)
    except SystemExit as end:  # SystemExit would end the command, which would look successful
        raise ValueError(f"{what} cannot be made: it calls exit({end})") from end


def unknown(what: str, word: str, known: Collection[str], also: str = "") -> ValueError:
    """The error for an unknown ``word``; the message has the nearest ``known`` name, all known names, and ``also``."""
    near = did_you_mean(word, known)
    return ValueError(f"unknown {what} {word!r}{f'{near} Known' if near else '; known'} are {', '.join(known)}{also}")


def did_you_mean(name: str, known: Iterable[str], most: int = 1) -> str:
    """A question such as ``; did you mean vary?`` with at most ``most`` similar names; empty if no name is similar."""
    spelt = {each.lower().replace("_", "-"): each for each in known}
    near = get_close_matches(name.lower().replace("_", "-"), spelt, most, 0.5)
    return f"; did you mean {' or '.join(spelt[each] for each in near)}?" if near else ""
