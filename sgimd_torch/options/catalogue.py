"""The catalogue: every name that the command line knows, with the place of its class, function or module.

    load_word("goals", "interest-map")            # InterestMap, which is imported now
    load_word("goals", "mypackage.goals:Curious") # a class of your own
To remove a feature, delete its folder and its lines of the table. The help text of a name is the first line of the
docstring at its place. The options are keywords of the signature there (`sgimd_torch.options.signature`).
"""

from __future__ import annotations

import importlib
import os
import re
import sys
from collections.abc import Callable, Collection, Iterable
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any, Final

from sgimd_torch.options import function_of

ROD: Final = "fishing-rod"
_TABLE: Final = """
algorithm    algorithms.paper           random=random_exploration sagg-riac observation imitation sgim-d
algorithm    algorithms.paper           sagg-riac-letter sgim-d-letter
algorithm    algorithms.practice        practice practice-taught
algorithm    asking.algorithms          sgim-im sgim-im-search sgim-acts sgim-acts-search
algorithm    rivals.quality_diversity   map-elites=map_elites_alone map-elites-taught=map_elites isoline=isoline_alone
algorithm    rivals.quality_diversity   isoline-taught=isoline cma-me=cma_me_alone cma-me-taught=cma_me
algorithm    rivals.quality_diversity   cma-mae=cma_mae_alone cma-mae-taught=cma_mae
environment  runs.tasks.rod             fishing-rod
environment  runs.tasks.robots          planar-arm-7 planar-arm-50
environment  environments.mujoco_robot  mujoco=MujocoRobot
environment  environments.lerobot       lerobot=LeRobotArm
goals        goals.interest_map         interest-map=InterestMap
goals        rivals.alp_gmm             alp-gmm=AlpGmm
goals        goals.uniform              uniform=UniformGoals
goals        goals.within_reach         within-reach=WithinReach
goals        asking.interest            strategic=StrategicInterest
progress     goals.regions              gained=gained_progress absolute=absolute_progress
search       searches.simplex           nelder-mead=NelderMead
search       searches.perturb           perturb=Perturb
search       searches.vary              vary=Vary
search       rivals.cma_es              cma-es=CmaEs
search       forward_model.search       gradient=GradientSearch gradient-then-nelder-mead=GradientThenNelderMead
explore      searches.explore           anywhere=Anywhere returning=Returning
inverse      inverses.locally_linear    linear=LocallyLinear
inverse      inverses.local             paper=LocalInverse
inverse      inverses.nearest           nearest=NearestNeighbour
inverse      inverses.local_process     process=LocalProcess
inverse      inverses.among_effects     among-effects=AmongEffects
inverse      forward_model.proved       model=ProvedModel
inverse      forward_model.inverse      model-alone=ModelAlone
network      forward_model.networks     perceptrons=Perceptrons
judge        competence                 memory=Competence attempt=AttemptCompetence
social       strategies                 imitate=Imitate emulate=Emulate
teacher      teachers                   periodic=PeriodicTeacher initial=InitialTeacher at-once asked=AskedTeacher
teacher      teach.by_hand              by-hand=ByHand
choose       teachers                   least-explored random=at_random
teachers     asking.teachers            all=AnsweringTeacher demonstrator-1 demonstrator-2 demonstrator-3
teachers     asking.teachers            low-half=low_half_teacher high-half=high_half_teacher
command      options.command_line       run
command      runs.sweep                 sweep
command      views.check                check
command      views.demonstrations       demonstrations
command      views.benchmark            benchmark
command      views.table                table
command      views.report.command       report
command      views.report.paper         paper
command      teach.command              teach
command      views.film.command         film
command      views.ask                  ask
command      views.demo                 demo
"""
WORDS: Final[dict[str, dict[str, str]]] = {line.split()[0]: {} for line in _TABLE.strip().splitlines()}
"""Place of each name, by kind; in ``_TABLE`` a line has the kind, a module, and names of its members."""
for _kind, _module, *_names in map(str.split, _TABLE.strip().splitlines()):
    for _name, _, _member in (name.partition("=") for name in _names):
        WORDS[_kind][_name] = _module if _kind == "command" else f"{_module}:{_member or _name.replace('-', '_')}"
# Default teacher of each taught algorithm; "teachers": the algorithm asks teachers. Other algorithms learn alone.
TAUGHT_BY: Final = {
    **dict.fromkeys(("observation", "imitation", "sgim-d", "sgim-d-letter"), "periodic"),
    **dict.fromkeys((word for word in WORDS["algorithm"] if word.endswith("-taught")), "periodic"),
    "practice-taught": "at-once",
    **dict.fromkeys((word for word, at in WORDS["algorithm"].items() if at.startswith("asking.")), "teachers"),
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
        raise unknown_name_error(kind, word, WORDS[kind], f"; {meant}")
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
    return load_place(f"{kind} {word}", place_of(kind, word), ours=word in WORDS[kind])


def load_place(what: str, place: str, *, ours: bool = False) -> Callable[..., Any]:
    """The class or function at a ``package.module:attribute``; ``what`` begins the message of an error.

    Raises:
        ValueError: see ``load_word``; if the place is ``ours``, the message of an ImportError is used as it is.
    """
    module, _, name = place.partition(":")
    folder = os.getcwd()
    if module.endswith(".py"):
        raise ValueError(f"{what}: write the module without .py and with dots, {module[:-3].replace('/', '.')}:{name}")
    if folder not in sys.path:
        sys.path.append(folder)
    try:
        loaded = importlib.import_module(module)
    except (Exception, SystemExit) as error:  # a user's module may raise anything
        if isinstance(error, ImportError) and ours:
            raise ValueError(str(error)) from error  # it names the extra that installs what is missing
        where = f"; is it installed, or in {folder}?" if isinstance(error, ImportError) else ""
        why = f"{type(error).__name__}: {error}{where}"
        raise ValueError(f"{what}: the module {module} cannot be imported: {why}") from error
    if not hasattr(loaded, name):
        raise ValueError(f"{what}: {module} has no {name}{did_you_mean(name, dir(loaded), 3)}")
    make: Callable[..., Any] = getattr(loaded, name)
    if not callable(make):
        raise ValueError(f"{what} must be a class or a function, got a {type(make).__name__}")
    return make


@cache
def about(kind: str, word: str) -> str:
    """Help text of a name of the catalogue: the first line of its docstring, read without importing the module."""
    module, _, name = WORDS[kind][word].partition(":")
    path = _PACKAGE / module.replace(".", "/")
    source = (path / "__init__.py" if path.is_dir() else path.with_suffix(".py")).read_text(encoding="utf-8")
    begin = rf"^(?:(?:class|def) {name}\b|{name} = )" if name else r"\A"
    described = re.search(begin + r'.*?"""(.*?)\.?(?:"""|\n)', source, re.DOTALL | re.MULTILINE)
    return described[1] if described else ""


def unknown_name_error(what: str, word: str, known: Collection[str], also: str = "") -> ValueError:
    """The error for an unknown ``word``; the message has the nearest ``known`` name, all known names, and ``also``."""
    near = did_you_mean(word, known)
    return ValueError(f"unknown {what} {word!r}{f'{near} Known' if near else '; known'} are {', '.join(known)}{also}")


def did_you_mean(name: str, known: Iterable[str], most: int = 1) -> str:
    """A question such as ``; did you mean vary?`` with at most ``most`` similar names; empty if no name is similar."""
    spellings = {word.lower().replace("_", "-"): word for word in known}
    near = get_close_matches(name.lower().replace("_", "-"), spellings, most, 0.5)
    return f"; did you mean {' or '.join(spellings[word] for word in near)}?" if near else ""
