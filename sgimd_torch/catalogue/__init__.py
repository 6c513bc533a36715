"""A list of words: everything that the command line can name, one record each, and where it is.

    find("goals", "grid").load()                    # ProgressGrid; imported now
    find("goals", "mypackage.goals:Curious")        # of your own
What can be set of a thing is told by its own signature, see `sgimd_torch.catalogue.options`; nothing here repeats it.
"""

from __future__ import annotations

import importlib
import inspect
import os
import sys
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import partial, wraps
from typing import Any, Final


@dataclass(frozen=True)
class Entry:
    """One thing with a name.

    Args:
        at: where it is, ``package.module:attribute``.
        about: what it is, for ``--help``.
        label, colour: what figures call an algorithm, and how they draw it.
        fixed: its parameter -> value, where the word is a preset of something more general; a text with a colon is an
            attribute, loaded like ``at``.
        teacher: of an algorithm that is shown something: when, unless a run says otherwise.
    """

    at: str
    about: str
    label: str = ""
    colour: str = "black"
    fixed: Mapping[str, object] = field(default_factory=dict)
    teacher: str = "periodic"

    def load(self) -> Any:
        """The thing itself, with what is fixed.

        Raises:
            ValueError: a package that it needs is not installed, or broken.
        """
        fixed = {
            name: load(value) if isinstance(value, str) and ":" in value else value
            for name, value in self.fixed.items()
        }
        return partial(load(self.at), **fixed) if fixed else load(self.at)


_IN_THE_PACKAGE: Final = "sgimd_torch"
_ALONE: Final = {"correspondence": None, "imitations": 0, "epsilon": 0.0}  # a learner without a teacher
_SCHOOL: Final = (  # of quality diversity
    ("map-elites", "fills an archive of outcomes", "MAP-Elites", ("#56b4e9", "#1f78a8")),
    ("isoline", "the same along lines between elites", "Isoline", ("#999933", "#5c5c1f")),
    ("cma-me", "the same with evolution strategies", "CMA-ME", ("#e69f00", "#8f6300")),
    ("cma-mae", "the same with thresholds that rise slowly", "CMA-MAE", ("#882255", "#4d1330")),
)


def _at(place: str, about: str, label: str = "", colour: str = "black", **more: Any) -> Entry:
    return Entry(f"{_IN_THE_PACKAGE}.{place}", about, label, colour, **more)


def _rod(about: str, **fixed: object) -> Entry:
    return _at("runs.tasks.rods:fishing_rod", about, fixed=fixed)


def _toy(name: str, side: float, about: str, *, module: str = "toys", **more: object) -> Entry:
    make = f"{_IN_THE_PACKAGE}.environments.{module}:{name}"
    return _at("runs.tasks.robots:toy", about, fixed={"make": make, "side": side, "taught": False, **more})


def _answering(about: str, knows: str = "", **fixed: object) -> Entry:
    known = {"knows": f"{_IN_THE_PACKAGE}.teachers.answering:{knows}"} if knows else {}
    return _at("teachers.answering:AnsweringTeacher", about, fixed={**known, **fixed})


ROD: Final = "fishing-rod"
# Colours after Okabe & Ito: distinct with any colour vision, and in grey.
CATALOGUE: Final[dict[str, dict[str, Entry]]] = {
    "algorithm": {
        "random": _at("algorithms:random_exploration", "uniform movements", "Random", "#7f7f7f"),
        "sagg-riac": _at("algorithms:sagg_riac", "goal babbling", "SAGG-RIAC", "#0072b2"),
        "practice": _at("algorithms:practice", "one movement a goal, by a local process", "Practice", "#332288"),
        "practice-taught": _at(
            "algorithms:practice_taught",
            "the same, and does once what it is shown",
            "Practice, taught",
            "#aa4499",
            teacher="at-once",
        ),
        "observation": _at("algorithms:observation", "watches and remembers, never moves", "Observation", "#cc79a7"),
        "imitation": _at("algorithms:imitation", "varies the last demonstration", "Imitation", "#009e73"),
        "sgim-d": _at("algorithms:sgim_d", "goal babbling and short imitations", "SGIM-D", "#d55e00"),
        "sgim-im": _at("algorithms.asking:sgim_im", "decides when to ask the one of --teachers", "SGIM-IM", "#661100"),
        "sgim-acts": _at("algorithms.asking:sgim_acts", "and which of them for what, and how", "SGIM-ACTS", "#cc6677"),
        "sgim-eer": _at("rivals.entropy:sgim_eer", "asks when that takes away more doubt", "By entropy", "#117733"),
        **{
            f"{name}{ending}": _at(
                f"rivals.quality_diversity:{name.replace('-', '_')}",
                f"{about}{shown} (extra rivals)",
                f"{label}, taught" if shown else label,
                colours[bool(shown)],
                fixed={} if shown else _ALONE,
            )
            for ending, shown in (("", ""), ("-taught", ", and imitates what it is shown"))
            for name, about, label, colours in _SCHOOL
        },
    },
    "environment": {
        ROD: _rod("the paper's arm with a rod, in MuJoCo"),
        "rod-wind": _rod("the rod in a side wind, up to a quarter of the float's weight: a context", max_wind=0.05),
        "rod-long": _rod("the rod with a line 1.5 times as long, taught with the shorter one", line=1.5),
        "planar-arm-7": _at("runs.tasks.robots:planar_arm", "7 joints, no noise", fixed={"n_joints": 7}),
        "planar-arm-50": _at("runs.tasks.robots:planar_arm", "50 joints, no noise", fixed={"n_joints": 50}),
        "swimmer": _at("runs.tasks.robots:swimmer", "gymnasium's Swimmer-v5: three links, two motors (extra gym)"),
        "half-reached": _at("runs.tasks.robots:half_reached", "7 joints, less than half of T can be reached"),
        "toss": _toy("toss", 0.4, "a ball in the wind, which is the context", taught=True),
        "crawler": _toy("crawler", 0.1, "four legs, whose phases are periodic parameters"),
        "two-elbows": _toy("two_elbows", 0.1, "an arm with two separate families of postures"),
        "spatial-arm": _toy("spatial_arm", 25.0, "six joints, three outcomes, in cm"),
        "puck": _toy("puck", 0.1, "a puck that has to be hit; where it lies is the context", module="objects"),
        "fetch": _toy("fetch", 0.1, "a ball that has to be grasped", module="objects"),
    },
    "goals": {
        "interest-map": _at("goals.interest_map:InterestMap", "where competence changes, in regions"),
        "grid": _at("goals.progress_grid:ProgressGrid", "the same in cells that never split"),
        "alp-gmm": _at("goals.alp_gmm:AlpGmm", "Gaussians of high progress (extra rivals)"),
        "uniform": _at("goals.uniform:UniformGoals", "anywhere in T, all equally likely"),
        "within-reach": _at("goals.within_reach:WithinReach", "the same where T is within reach, else around what is"),
    },
    "progress": {
        "gained": _at("goals.regions:gained_progress", "how much attempts raise the competence at their own goals"),
        "absolute": _at("goals.regions:absolute_progress", "newer competences against older ones, the paper's eq. (3)"),
        "signed": _at("goals.regions:signed_progress", "the same, but falling competence does not count"),
        "paired": _at("goals.regions:paired_progress", "difference from the competence at the nearest earlier goal"),
    },
    "search": {
        "nelder-mead": _at("searches.simplex:nelder_mead", "a simplex of neighbours, a little noise on every movement"),
        "nelder-mead-exact": _at("searches.simplex:nelder_mead", "without the noise", fixed={"noise": 0.0}),
        "nelder-mead-complete": _at(
            "searches.simplex:nelder_mead",
            "without the noise, from the paper's complete simplex of 26, ended by the budget alone",
            fixed={"noise": 0.0, "complete": True, "xatol": 1e-4, "fatol": 1e-4},
        ),
        "perturb": _at("searches.perturb:perturb", "the best so far plus noise"),
        "practice": _at("searches.perturb:practise", "what the inverse model infers plus a little noise"),
        "cma-es": _at("searches.cma_es:cma_es", "an evolution strategy (extra rivals)"),
        "gradient": _at("searches.through_model:gradient_search", "by the gradient of a forward model (extra forward)"),
        "gauss-newton": _at(
            "searches.through_model:gradient_search",
            "a new plan through it for each movement (extra forward)",
            fixed={"propose": "sgimd_torch.searches.through_model:gauss_newton"},
        ),
    },
    "explore": {
        "anywhere": _at("algorithms:anywhere", "uniformly from Pi"),
        "widening": _at("searches.widening:Widening", "around the middle of Pi, as wide as can be predicted"),
        "returning": _at("searches.returning:Returning", "the same; if effects are rare, around what had one"),
    },
    "inverse": {
        "linear": _at("inverses.locally_linear:LocallyLinear", "eq. (9) corrected to first order"),
        "paper": _at("inverses.local:LocalInverse", "the weighted mean of eq. (9)"),
        "nearest": _at("inverses.local:NearestNeighbour", "the movement that came nearest"),
        "process": _at("inverses.local_process:LocalProcess", "a local Gaussian process, where it beats the nearest"),
        "among-effects": _at("inverses.among_effects:AmongEffects", "the same; if effects are rare, from them alone"),
        "model": _at("inverses.proved:ProvedModel", "process, then a forward model that beats it (extra forward)"),
        "model-alone": _at(
            "inverses.through_model:ModelInverse",
            "linear when learning, a forward model in evaluations, proved or not (extra forward)",
        ),
    },
    "judge": {
        "memory": _at("algorithms:remembered", "competence by all movements ever made, as in the paper"),
        "attempt": _at("algorithms:attempted", "by those made for this goal"),
    },
    "social": {
        "imitate": _at("algorithms:imitating", "repeat a demonstration a few times"),
        "emulate": _at("algorithms:emulating", "pursue its outcome in the learner's own way"),
    },
    "base": {
        "practice": _at("algorithms.asking:practised", "one movement a goal, and once what is shown"),
        "search": _at("algorithms.asking:searched", "a search at each goal and short imitations, as in the papers"),
    },
    "teacher": {
        "periodic": _at("teachers:PeriodicTeacher", "one every so many movements"),
        "initial": _at("teachers:InitialTeacher", "all at the start, one every so many movements"),
        "at-once": _at("teachers:InitialTeacher", "all at the start, one for each movement", fixed={"every": 1}),
        "asked": _at("teachers:AskedTeacher", "when the learner stalls"),
        "by-hand": _at("teachers.by_hand:nobody", "a person, whenever they like: sgimd teach"),
    },
    "choose": {
        "least-explored": _at("teachers:least_explored", "the one whose outcome the learner has reached least"),
        "random": _at("teachers:at_random", "any"),
    },
    "teachers": {
        "all": _answering("shows the nearest of all demonstrations"),
        **{
            f"demonstrator-{number}": _answering(
                f"has the recordings of the rod's demonstrator {number}", f"demonstrator_{number}"
            )
            for number in (1, 2, 3)
        },
        "low-half": _answering("has those of the lower half of the first outcome", "low_half"),
        "high-half": _answering("has those of the upper half", "high_half"),
        "mislabelling": _answering("shows something else than is said", "mislabelled"),
        "slow": _answering("the nearest of all, for which the learner rests 10 movements", takes=10),
    },
}
# Parts that several others share: made once for a run, and only if something takes a parameter of this name.
SHARED: Final = {
    "model": _at("forward_model.model:ForwardModel", "the forward model (extra forward)"),
    "trust": _at("forward_model.anchored:Trust", "how far to trust the forward model"),
}
# What a thing of your own must have: how it is called, and the members of what it returns.
_WANTED: Final[dict[str, tuple[str, tuple[str, ...]]]] = {
    "algorithm": ("(environment, seed, ...) -> a Learner", ("ask", "tell", "watch", "memory", "inverse")),
    "environment": (
        "() -> an environment or a Task",
        ("contexts", "policies", "outcomes", "rest", "outcome_noise", "observe", "execute"),
    ),
    "goals": ("(contexts, outcomes, rng) -> a goal model", ("sample", "add")),
    "progress": ("(goals, competences, gains) of a region -> its interest", ()),
    "judge": ("(memory, measure) -> a judge of competence", ("__call__",)),
    "search": ("(policies, rng) -> a search", ("__call__",)),
    "explore": ("(policies, memory, inverse, rng) -> an explorer", ("__call__",)),
    "inverse": ("(memory) -> an inverse model", ("__call__",)),
    "base": ("(environment) -> what a learner that asks does on its own, and how it answers", ("parts", "ways")),
    "social": ("(goal babbling, outcomes, rng) -> a social strategy", ("attempt",)),
    "teacher": ("(demonstrations, rng) -> a teacher", ("offer",)),
    "teachers": ("(demonstrations, rng) -> a teacher who answers", ("demonstrate",)),
    "choose": ("(demonstrations, memory, rng) -> a demonstration", ()),
}


def find(kind: str, word: str) -> Entry:
    """The record of what ``word`` names.

    Raises:
        ValueError: it is neither in the catalogue nor an attribute that can be loaded and called.
    """
    known = CATALOGUE[kind]
    if word in known:
        return known[word]
    if ":" not in word:
        module, dot, name = word.rpartition(".")
        meant = f"; is it {module}:{name}?" if dot else ", and package.module:attribute for one of your own"
        raise unknown(kind, word, known, meant)
    made = load(word, f"{kind} {word}")
    if not callable(made):
        raise ValueError(f"{kind} {word} must be called as {_WANTED[kind][0]}, but it is a {type(made).__name__}")
    return Entry(word, "of your own")


def check_constructors(**parts: object) -> None:
    """Refuse a word of the command line, or a part that is made already, where a learner wants a constructor.

    Raises:
        ValueError: with the import or the call that was meant.
    """
    for kind, part in parts.items():
        if isinstance(part, str):
            module, _, name = find(kind, part).at.partition(":")
            raise ValueError(f"{kind} must be a constructor, got the word {part!r}; from {module} import {name}")
        if not callable(part):
            raise ValueError(f"{kind} must be a constructor, {_WANTED[kind][0]}, got a {type(part).__name__}")


def word_of(kind: str, made: Callable[..., Any]) -> str:
    """What a default is called: a word of the catalogue, or package.module:attribute; "" if it has no such name."""
    made = made.func if isinstance(made, partial) else made
    place = f"{made.__module__}:{made.__qualname__}"
    words = (word for word, entry in CATALOGUE[kind].items() if entry.at == place and not entry.fixed)
    return next(words, "" if "<" in place else place)


def checked(kind: str, word: str, make: Callable[..., Any]) -> Callable[..., Any]:
    """``make``, with a check of how it is called and of what it gives: one of your own may differ from its kind.

    Raises (when called):
        ValueError: with the call that was wanted, or the names of the members that are missing.
    """
    wanted, members = _WANTED[kind]

    @wraps(make)
    def made(*arguments: Any, **options: Any) -> Any:
        try:
            inspect.signature(make).bind(*arguments, **options)
        except TypeError as error:
            raise ValueError(f"{kind} {word} cannot be called as {wanted}: {error}") from error
        try:
            part = make(*arguments, **options)
        except SystemExit as end:  # it must not end the command, which would look like success
            raise ValueError(f"{kind} {word} cannot be made: it calls exit({end})") from end
        robot = getattr(part, "environment", part) if kind == "environment" else part  # of a Task
        missing = [name for name in members if not hasattr(robot, name)]
        if missing:
            raise ValueError(
                f"{kind} {word} gave a {type(robot).__name__} without {', '.join(missing)}; wanted {wanted}, "
                f"which has {', '.join(members)}"
            )
        return part

    return made


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
        if isinstance(error, ImportError) and module.startswith(_IN_THE_PACKAGE):
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


def label(algorithm: str) -> str:
    """What figures call an algorithm; the word itself where they have no other name."""
    entry = CATALOGUE["algorithm"].get(algorithm)
    return entry.label if entry and entry.label else algorithm


def colour(algorithm: str) -> str:
    """How figures draw an algorithm."""
    entry = CATALOGUE["algorithm"].get(algorithm)
    return entry.colour if entry else "black"


def unknown(what: str, word: str, known: Collection[str], also: str = "") -> ValueError:
    """The error for a ``word`` that is none of those ``known``: the nearest first, then all, then ``also``."""
    near = did_you_mean(word, known)
    return ValueError(f"unknown {what} {word!r}{f'{near} Known' if near else '; known'} are {', '.join(known)}{also}")


def did_you_mean(name: str, known: Iterable[str], most: int = 1) -> str:
    """``; did you mean grid?``, with the ``most`` names that are near; nothing where no known name is."""
    spelt = {each.lower().replace("_", "-"): each for each in known}
    near = get_close_matches(name.lower().replace("_", "-"), spelt, most, 0.5)
    return f"; did you mean {' or '.join(spelt[each] for each in near)}?" if near else ""
