"""The catalogue: every name that the command line knows, with a reference to its class, function or module.

    load_word("goals", "interest-map")            # InterestMap, which is imported now
    load_word("goals", "mypackage.goals:Curious") # a class of your own
Here are the names of the core; each room brings its own (`sgimd_torch.rooms`). A reference is ``module:attribute``. The
help text of a name is the first line of the docstring there; the options are the keywords of the signature there.
"""

from __future__ import annotations

import importlib
import os
import re
import sys
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any, Final

from sgimd_torch.calls import function_of
from sgimd_torch.rooms import Usual, brought, room_of
from sgimd_torch.texts import did_you_mean, unknown_name_error

ROD: Final = "fishing-rod"
_TABLE: Final = """
algorithm    algorithms.paper           random=random_exploration sagg-riac observation imitation sgim-d
algorithm    algorithms.paper           sagg-riac-letter sgim-d-letter
algorithm    algorithms.practice        practice practice-taught
environment  tasks.rod                  fishing-rod
environment  tasks.robots               planar-arm-7 planar-arm-50
goals        goals.interest_map         interest-map=InterestMap
goals        goals.uniform              uniform=UniformGoals
goals        goals.within_reach         within-reach=WithinReach
progress     goals.regions              gained=gained_progress absolute=absolute_progress
search       searches.simplex           nelder-mead=NelderMead
search       searches.perturb           perturb=Perturb
search       searches.vary              vary=Vary
search       forward_model.search       gradient=GradientSearch
explore      searches.explore           anywhere=Anywhere returning=Returning
inverse      inverses.locally_linear    linear=LocallyLinear
inverse      inverses.local             paper=LocalInverse
inverse      inverses.nearest           nearest=NearestNeighbour
inverse      inverses.local_process     process=LocalProcess
inverse      inverses.among_effects     among-effects=AmongEffects
inverse      forward_model.proved       model=ProvedModel
inverse      forward_model.inverse      model-alone=ModelAlone
network      forward_model.networks     perceptrons=Perceptrons
memory       memory                     flat=FlatMemory graph=Memory scan=ScanMemory
judge        competence                 memory=Competence attempt=AttemptCompetence
social       strategies                 imitate=Imitate emulate=Emulate
watch        algorithms                 none=nobody
teacher      teachers                   periodic=PeriodicTeacher initial=InitialTeacher at-once asked=AskedTeacher
choose       teachers                   least-explored random=at_random
hook         board                      board=Board
command      runs.command               run
"""
WORDS: Final[dict[str, dict[str, str]]] = {}
"""Reference of each name, by kind; in ``_TABLE`` a line has the kind, a module, and names of its members."""
_lines = ((kind, module, names) for kind, module, *names in map(str.split, _TABLE.strip().splitlines()))
for _kind, _module, _names in (*_lines, *brought("WORDS")):
    for _name, _, _member in (name.partition("=") for name in _names):
        _at = _module if _kind == "command" else f"{_module}:{_member or _name.replace('-', '_')}"
        WORDS.setdefault(_kind, {})[_name] = _at
_PACKAGE: Final = Path(__file__).parents[1]
OURS: Final = {f"{_PACKAGE.name}.{at}" for words in WORDS.values() for at in words.values()}
"""References of the catalogue. All others are code of a user, even in this library: from a module of ours, dots may
lead to any module that it imports."""


def reference_of(kind: str, word: str) -> str:
    """Reference of the class, function or module that ``word`` names, as ``package.module:attribute``.

    Raises:
        ValueError: the name is neither in the catalogue nor a reference.
    """
    if word in WORDS[kind]:
        return f"{_PACKAGE.name}.{WORDS[kind][word]}"
    if ":" in word:
        return word
    module, dot, name = word.rpartition(".")
    meant = f"is it {module}:{name}?" if dot else "or is it package.module:attribute, or of a room that is missing?"
    meant = "for a model file see docs/how-to/mujoco.md" if name in ("xml", "urdf") else meant
    raise unknown_name_error(kind, word, WORDS[kind], f"; {meant}")


def word_of(kind: str, make: Callable[..., Any]) -> str:
    """The name of a class or function, or its reference if it has no name; the inverse of ``reference_of``."""
    if isinstance(make, Usual):
        return make.word
    reference = f"{function_of(make).__module__}:{function_of(make).__qualname__}"
    return next((word for word, at in WORDS[kind].items() if f"{_PACKAGE.name}.{at}" == reference), reference)


def rooms_of(words: Iterable[tuple[str, str]]) -> list[str]:
    """Names of the rooms that bring these words, given with their kinds."""
    return sorted({room for kind, word in words if (room := room_of(WORDS.get(kind, {}).get(word, "")))})


def load_word(kind: str, word: str) -> Callable[..., Any]:
    """The class or function that ``word`` names; its module is searched in the working directory, too.

    Raises:
        ValueError: there is none, its module cannot be imported, or it cannot be called; the message says why.
    """
    return load_reference(f"{kind} {word}", reference_of(kind, word), ours=word in WORDS[kind])


def load_reference(what: str, reference: str, *, ours: bool = False) -> Callable[..., Any]:
    """The class or function at a ``package.module:attribute``; ``what`` begins the message of an error.

    Raises:
        ValueError: see ``load_word``; if the reference is ``ours``, the message of an ImportError is used as it is.
    """
    module, _, name = reference.partition(":")
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
