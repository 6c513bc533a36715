"""What a run is made of: its own options, and the parts that were chosen with theirs.

Each default is the library's own; a run with one changed option is an ablation.
    config = Config(algorithm="sagg-riac", parts={"goals": "grid", "goals.window": 12}); config["search.noise"]
The keywords of a part's signature are its options (`sgimd_torch.catalogue.options`): one keyword more, one option more.
A keyword with the name of a kind of the catalogue is a choice, which leads to the next part.
"""

from __future__ import annotations

import importlib.util
import inspect
import json
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, fields
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Final, Self

from sgimd_torch.catalogue import CATALOGUE, ROD, SHARED, did_you_mean, find, word_of
from sgimd_torch.catalogue.options import Option, options_of, parameters_of

OWN: Final = "own"  # the answer of the inverse model that a run chose
FILES: Final = ("benchmark", "demonstrations")  # options that name a file
THREADS: Final = "environment.threads"
PLACE: Final = ("seed", "out", "name", "board", THREADS)  # they do not change the learner
EVALUATES: Final = ("evaluated_by", "repeats", "floor_at", "benchmark_crc32")  # all evaluations of a run share these
MAY_CHANGE: Final = (
    *("movements", "out", "name", "board", "failures", "evaluate_at"),
    *(*FILES, *EVALUATES, THREADS),
)
"""When a run is resumed, as they only say how long it lasts, where it is or how it is shown. Files count by their
content, of which a checksum is recorded; a benchmark may be another one."""
ALGORITHM: Final = ""  # the name of this part; its options have no prefix
_HANDED: Final = ("outcome_noise", "seed", "strategy")  # no options: whoever makes a part gives it these
_TEACHERS: Final = Option(tuple[str, ...], ("all",))


@dataclass(frozen=True)
class Config:
    """One run.

    Args:
        algorithm: which learner, see below; practice for a robot without demonstrations.
        seed: of all random streams; the same seed gives the same run.
        movements: number of movements, those at rest included.
        out: folder for runs; this one goes to OUT/NAME/seed-003.
        name: NAME in that path, to keep a variant apart; null is the algorithm's.
        board: whether curves and pictures for TensorBoard are written, into its folder.
        evaluate_at: movements after which to evaluate, besides the end; null is 250, 500 and every 1000; [] never.
        evaluated_by: which inverse models answer in evaluations: own is that of --inverse, others are its words.
        repeats: how often each movement of an evaluation is executed again to measure the noise; 0 does not.
        floor_at: which evaluations measure the noise, which takes four times as long; null is all.
        benchmark: file of the goals to evaluate on; null is the environment's own.
        demonstrations: file of recorded demonstrations; null is the environment's own.
        failures: failed movements in a row that stop the run; null is ten.
        parts: by name, such as "goals" or "goals.window", what is chosen for it; what differs from its default is kept.

    Raises:
        ValueError: a value or a name that makes no sense.
    """

    algorithm: str = "practice-taught"
    seed: int = 0
    movements: int = 5000
    out: Path = Path("runs")
    name: str | None = None
    board: bool = False
    evaluate_at: tuple[int, ...] | None = None
    evaluated_by: tuple[str, ...] = (OWN, "linear")
    repeats: int = 3
    floor_at: tuple[int, ...] | None = None
    benchmark: Path | None = None
    demonstrations: Path | None = None
    failures: int | None = None
    parts: Mapping[str, Any] | tuple[tuple[str, Any], ...] = ()

    def __post_init__(self) -> None:
        given = {name: tuple(value) if isinstance(value, list) else value for name, value in dict(self.parts).items()}
        for name in given:
            if name not in self.standards:
                raise self._refused(name)
        differing = sorted((name, value) for name, value in given.items() if value != self.standards[name])
        object.__setattr__(self, "parts", tuple(differing))
        for name, least in (("seed", 0), ("movements", 1), ("repeats", 0)):
            if getattr(self, name) < least:
                raise ValueError(f"{name} must be at least {least}, got {getattr(self, name)}")
        if self.failures is not None and self.failures < 1:
            raise ValueError(f"failures must be at least 1, got {self.failures}")
        if self.repeats == 1:
            raise ValueError("repeats must be 0 or at least 2, got 1; one landing point does not scatter")
        for name in ("evaluate_at", "floor_at"):
            if min(getattr(self, name) or (1,)) < 1:
                raise ValueError(f"{name} must be numbers of movements, at least 1, got {getattr(self, name)}")
        for name, words in (("evaluated_by", self.evaluated_by), ("teachers", self.values.get("teachers", ("",)))):
            if not words or len({*words}) < len(words):
                raise ValueError(f"{name} must name at least one, and each once, got {','.join(words)}")
        if self.evaluated_by[0] != OWN:
            raise ValueError(f"evaluated_by must begin with {OWN}, got {','.join(self.evaluated_by)}")
        for answer in self.evaluated_by[1:]:
            find("inverse", answer)
        if self.board and importlib.util.find_spec("tensorboard") is None:
            raise ValueError("board true needs tensorboard, which is not installed; pip install 'sgimd-torch[board]'")
        if self.variant in ("", ".", "..") or any(sign in self.variant for sign in "/\\\0"):
            raise ValueError(f"name must be that of one directory, got {self.variant!r}; is the path for --out?")

    def __getitem__(self, name: str) -> Any:
        """What an option or a part is in this run, "goals.window" say.

        Raises:
            KeyError: the run has no such option.
        """
        return getattr(self, name) if name in RUN else self.values[name]

    def __contains__(self, name: object) -> bool:
        """Whether this run has such an option or part."""
        return name in RUN or name in self.values

    @cached_property
    def chosen(self) -> dict[str, Part]:
        """The parts that the run is put together from, by name."""
        return chosen(self.algorithm, dict(self.parts))

    @cached_property
    def standards(self) -> dict[str, Any]:
        """By name, what every part and every option of a part is unless a run says otherwise."""
        found: dict[str, Any] = {}
        for name, part in self.chosen.items():
            if name != ALGORITHM and name not in SHARED:
                found[name] = part.standard
            found |= {part.full(each): option.default for each, option in part.options.items()}
        return found

    @cached_property
    def values(self) -> dict[str, Any]:
        """By name, every part and every option of a part."""
        return {**self.standards, **dict(self.parts)}

    @property
    def settings(self) -> dict[str, Any]:
        """All that makes this run, as json has it; ``from_settings`` makes the same one of it."""
        return plain({**self.values, **{name: getattr(self, name) for name in RUN}})

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """The run with these ``settings``; what they lack has its default.

        Raises:
            ValueError: they make no sense, or name an option that there is not.
        """
        own: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value for name, value in settings.items()
        }
        own |= {name: Path(own[name]) for name in ("out", *FILES) if own.get(name) is not None}
        parts = {name: value for name, value in own.items() if name not in RUN and not name.endswith("_crc32")}
        return cls(**{name: own[name] for name in RUN if name in own}, parts=parts)

    @property
    def variant(self) -> str:
        """The name of the run's directory and of its curve."""
        return self.algorithm.replace("/", "-") if self.name is None else self.name

    @property
    def directory(self) -> Path:
        """Where the run is written."""
        return self.out / self.variant / f"seed-{self.seed:03d}"

    @property
    def title(self) -> str:
        """The name of the run in messages."""
        return f"{self.variant} seed {self.seed}"

    @property
    def evaluations(self) -> list[int]:
        """The numbers of movements after which to evaluate, in order."""
        if self.evaluate_at == ():
            return []
        standard = (250, 500, *range(1000, self.movements, 1000))
        wanted = standard if self.evaluate_at is None else self.evaluate_at
        return sorted({movements for movements in wanted if movements < self.movements} | {self.movements})

    @property
    def uses_model(self) -> bool:
        """Whether a forward model is learnt."""
        return "model.members" in self.values

    @property
    def answered(self) -> list[str]:
        """The answers that its evaluations have: without a forward model, none by a model."""
        if self.uses_model:
            return list(self.evaluated_by)
        return [word for word in self.evaluated_by if word == OWN or "model" not in part_of("", "inverse", word).takes]

    def _refused(self, name: str) -> ValueError:
        """The error for a name that is none of this run, with the part that has it."""
        owner, _, last = name.rpartition(".")
        if owner not in self.chosen:  # what it belongs to is no part of this run, either
            owner, last = ALGORITHM, owner.partition(".")[0]
        part, having = self.chosen[owner], []
        for kind in (part.kind,) if owner != ALGORITHM or _with(part.kind, last) else CATALOGUE:
            if words := ", ".join(_with(kind, last)):
                spelt_so = "" if kind == part.kind or last in SHARED else f" (--{kind}.{last})"
                having.append(f"{kind} {words}{spelt_so}")
        near = [each for each in (*self.standards, *RUN, *FLAGS) if each.rpartition(".")[0] == owner]
        more = f"; {' and '.join(having)} have it" if having else dashed(did_you_mean(name, near, 2))
        return ValueError(f"--{dashed(name)}: {part.kind} {part.word} has no such option{more}")


RUN: Final = tuple(each.name for each in fields(Config) if each.name != "parts")
"""The options that every run has."""
FLAGS: Final = {
    "resume": "go on with a stopped or killed run, or lengthen a finished one.",
    "accept_loss": "with --resume: go on even if the log has lost movements; a copy of it is kept.",
}


@dataclass(frozen=True)
class Part:
    """A part of a run.

    Args:
        name: of the part in the run, "goals" or "goals.progress" say.
        kind, word: what was chosen; of a shared part both are its name.
        standard: the word if nobody chooses.
        make: the thing itself, with what its word fixes.
        takes: names of all its parameters, but those that its word fixes.
        options: those of them that a run can set.
        choices: those that lead to other parts, and their defaults.
    """

    name: str
    kind: str
    word: str
    standard: str
    make: Callable[..., Any]
    takes: Collection[str]
    options: Mapping[str, Option]
    choices: Mapping[str, Callable[..., Any]]

    @property
    def teaching(self) -> str:
        """Of an algorithm: "teachers" that it asks, a "teacher" who shows it something, or "" if it learns alone."""
        if self.kind != "algorithm":
            return ""
        return "teachers" if "teachers" in self.takes else "teacher" if "correspondence" in self.takes else ""

    def full(self, parameter: str) -> str:
        """The name of a parameter in the run."""
        return f"{self.name}.{parameter}" if self.name else parameter

    def set_by(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The keywords that it gets from what a run has set."""
        return {each: values[self.full(each)] for each in self.options if each != "teachers"}


def part_of(name: str, kind: str, word: str, default: Callable[..., Any] | str = "") -> Part:
    """The part that a word names.

    Args:
        name: of the part in the run.
        kind: of the catalogue, or the name of a shared part.
        word: of that kind, or package.module:attribute; "" for the default.
        default: the word if nobody chooses, or the default of the parameter that leads here, which may have options
            of its own.

    Raises:
        ValueError: there is no such thing, or a package that it needs is not installed.
    """
    standard = default if isinstance(default, str) else word_of(kind, default)
    word = word or standard
    return (_read if ":" in word else _READ)(name, kind, word, standard, default)  # a user's own may change


def _read(name: str, kind: str, word: str, standard: str, default: Callable[..., Any] | str) -> Part:
    entry = SHARED[kind] if kind in SHARED else find(kind, word)
    make = default if callable(default) and word == standard else entry.load()
    takes = {each: known.default for each, known in parameters_of(make).items() if each not in entry.fixed}
    options = {each: known for each, known in options_of(make).items() if each in takes and each not in _HANDED}
    if kind == "algorithm" and "teachers" in takes:
        options["teachers"] = _TEACHERS
    choices = {each: value for each, value in takes.items() if each in CATALOGUE and _has_name(each, value)}
    return Part(name, kind, word, standard or word, make, takes, options, choices)


_READ: Final = cache(_read)


def chosen(algorithm: str, given: Mapping[str, Any]) -> dict[str, Part]:
    """The parts of a run by name: first the algorithm and the environment, then those that others lead to.

    Args:
        algorithm: which learner.
        given: by name, what was chosen; what names no part of this run is passed over.

    Raises:
        ValueError: see ``part_of``.
    """
    found: dict[str, Part] = {}

    def take(name: str, kind: str, default: Callable[..., Any] | str) -> None:
        part = found[name] = part_of(name, kind, given.get(name, ""), default)
        for parameter, value in part.choices.items():
            take(part.full(parameter), parameter, value)
        for each in SHARED:
            if each in part.takes and each not in found:
                take(each, each, each)

    take("environment", "environment", ROD)
    take(ALGORITHM, "algorithm", algorithm)
    if found[ALGORITHM].teaching == "teacher":
        take("teacher", "teacher", find("algorithm", algorithm).teacher)
    for word in given.get("teachers", ()) if found[ALGORITHM].teaching == "teachers" else ():
        find("teachers", word)
    return found


def _has_name(kind: str, default: Any) -> bool:
    return callable(default) and default is not inspect.Parameter.empty and word_of(kind, default) != ""


def _with(kind: str, name: str) -> list[str]:
    """The words of a kind whose parts have an option, or lead to a part, of this name."""
    found = []
    for word in CATALOGUE.get(kind, ()):
        with suppress(ValueError):  # one that is not installed has nothing
            part = part_of(ALGORITHM, kind, word)
            if name in (*part.options, *part.choices, *SHARED.keys() & part.takes, part.teaching):
                found.append(word)
    return found


def code_of(settings: Mapping[str, Any]) -> list[str]:
    """The code of a user's own that ``settings`` name, ``package.module:attribute``: it is not in this library."""
    values = [value for name, value in settings.items() if name not in (*PLACE, *FILES)]
    words = [word for value in values for word in (value if isinstance(value, list) else [value])]
    return sorted({w for w in words if isinstance(w, str) and ":" in w and not w.startswith("sgimd_torch.")})


def words(config: Config) -> list[str]:
    """The command line of ``sgimd run`` for a run: ``--dashed-name=value`` for all that is not at its default."""
    standard = {each.name: each.default for each in fields(Config)}
    own = [
        (name, getattr(config, name)) for name in RUN if getattr(config, name) != standard[name] or name == "algorithm"
    ]
    return [f"--{dashed(name)}={typed(value)}" for name, value in (*own, *dict(config.parts).items())]


def dashed(name: str) -> str:
    """As the command line spells it."""
    return name.replace("_", "-")


def plain(value: Any) -> Any:
    """As json has it."""
    return json.loads(json.dumps(value, default=str))


def typed(value: Any) -> str:
    """A value as one types it."""
    if isinstance(value, tuple):
        return ",".join(map(typed, value)) or "[]"
    return json.dumps(value) if value is None or isinstance(value, bool) else str(value)
