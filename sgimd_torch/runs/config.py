"""Settings of a run: its own options, and the parts that were chosen with theirs.

Each default is the library's own; a run with one changed option is an ablation.
    config = Config(algorithm="sagg-riac", parts={"goals": "grid", "goals.window": 12}); config["search.noise"]
The keywords of a part's signature are its options (`sgimd_torch.catalogue.options`): one keyword more, one option more.
A keyword whose default is in the catalogue is a choice, which leads to the next part.
"""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, fields
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Any, Final, Self

from sgimd_torch.catalogue import ROD, TAUGHT_BY, WORDS, did_you_mean, load_word, named, place_of
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


@dataclass(frozen=True)
class Config:
    """One run.

    Args:
        algorithm: learner, see below; default for a robot without demonstrations: practice.
        seed: number from which all random streams come; one seed gives one run.
        movements: number of movements, those at rest included.
        teachers: teachers whom the learner asks, by words; null is all demonstrations, for an algorithm that asks.
        out: folder for runs; this one goes to OUT/NAME/seed-003.
        name: NAME in that path, to keep a variant apart; null is the algorithm's.
        board: true writes curves and pictures for TensorBoard into the run's folder.
        evaluate_at: movements after which to evaluate, besides the end; null is 250, 500 and every 1000; [] never.
        evaluated_by: inverse models that answer in evaluations: own is the run's, others are words of --inverse.
        repeats: executions of each movement of an evaluation that measure the noise; 0 does not.
        floor_at: evaluations that measure the noise, which takes four times as long; null is all.
        benchmark: file of goals to evaluate on; null is the environment's own.
        demonstrations: file of recorded demonstrations; null is the environment's own.
        failures: failed movements in a row that stop the run; null is ten.
        parts: choices by name, such as "goals" or "goals.window"; what differs from its default is kept.

    Raises:
        ValueError: a value or a name that makes no sense.
    """

    algorithm: str = "practice-taught"
    seed: int = 0
    movements: int = 5000
    teachers: tuple[str, ...] | None = None
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
        for name, least in (("seed", 0), ("movements", 1), ("repeats", 0), ("failures", 1)):
            value = getattr(self, name)
            if value is not None and value < least:
                raise ValueError(f"{name} must be at least {least}, got {value}")
        if self.repeats == 1:
            raise ValueError("repeats must be 0 or at least 2, got 1; one landing point does not scatter")
        for name in ("evaluate_at", "floor_at"):
            if min(getattr(self, name) or (1,)) < 1:
                raise ValueError(f"{name} must be numbers of movements, at least 1, got {getattr(self, name)}")
        for name in ("evaluated_by", "teachers"):
            words = getattr(self, name)
            if words is not None and (not words or len({*words}) < len(words)):
                raise ValueError(f"{name} must name at least one, and each once, got {','.join(words)}")
        if self.evaluated_by[0] != OWN:
            raise ValueError(f"evaluated_by must begin with {OWN}, got {','.join(self.evaluated_by)}")
        for kind, words in (("inverse", self.evaluated_by[1:]), ("teachers", self.teachers or ())):
            for word in words:
                place_of(kind, word)
        if self.teachers is not None and self.teaching != "teachers":
            raise self._refused("teachers")
        if self.board and importlib.util.find_spec("tensorboardX") is None:
            raise ValueError("board true needs tensorboardX, which is not installed; pip install 'sgimd-torch[board]'")
        if self.variant in ("", ".", "..") or any(sign in self.variant for sign in "/\\\0"):
            raise ValueError(f"name must be that of one directory, got {self.variant!r}; is the path for --out?")

    def __getitem__(self, name: str) -> Any:
        """Value of an option or a part in this run, "goals.window" say.

        Raises:
            KeyError: the run has no such option.
        """
        return getattr(self, name) if name in RUN else self.values[name]

    def __contains__(self, name: object) -> bool:
        """Whether this run has such an option or part."""
        return name in RUN or name in self.values

    @cached_property
    def chosen(self) -> dict[str, Part]:
        """Parts of the run, by name."""
        return chosen(self.algorithm, dict(self.parts), asks=self.teachers is not None)

    @property
    def teaching(self) -> str:
        """ "teachers" that its learner asks, a "teacher" who shows it something, or "" if it learns alone."""
        return teaching(self.algorithm, dict(self.parts), asks=self.teachers is not None)

    @cached_property
    def standards(self) -> dict[str, Any]:
        """Defaults of every part and every option of a part, by name."""
        found: dict[str, Any] = {}
        for name, part in self.chosen.items():
            if name != ALGORITHM:
                found[name] = part.standard
            found |= {part.full(each): option.default for each, option in part.options.items()}
        return found

    @cached_property
    def values(self) -> dict[str, Any]:
        """Every part and every option of a part, by name."""
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
        """Name of the run's directory and of its curve."""
        return self.algorithm.replace("/", "-") if self.name is None else self.name

    @property
    def directory(self) -> Path:
        """Folder of the run."""
        return self.out / self.variant / f"seed-{self.seed:03d}"

    @property
    def title(self) -> str:
        """Name of the run in messages."""
        return f"{self.variant} seed {self.seed}"

    @property
    def evaluations(self) -> list[int]:
        """Numbers of movements after which to evaluate, in order."""
        if self.evaluate_at == ():
            return []
        standard = (250, 500, *range(1000, self.movements, 1000))
        wanted = standard if self.evaluate_at is None else self.evaluate_at
        return sorted({movements for movements in wanted if movements < self.movements} | {self.movements})

    def _refused(self, name: str) -> ValueError:
        """The error for a name that is none of this run, with the parts that have it."""
        owner, _, last = name.rpartition(".")
        if owner not in self.chosen:  # what it belongs to is no part of this run, either
            head = owner.partition(".")[0]
            owner, last = ALGORITHM, head if any(_with(kind, head) for kind in WORDS) else last
        part, having = self.chosen[owner], []
        for kind in (part.kind,) if owner != ALGORITHM or _with(part.kind, last) else WORDS:
            if words := ", ".join(_with(kind, last)):
                having.append(f"{kind} {words}" + (f" (--{kind}.{last})" if kind != part.kind else ""))
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
        name: name of the part in the run, "goals" or "goals.progress" say.
        kind: kind of the catalogue.
        word: word of that kind that was chosen.
        standard: word if nobody chooses.
        make: constructor, with what its word fixes.
        options: keywords that a run can set.
        choices: keywords that lead to other parts, with the kind and the default of each.
    """

    name: str
    kind: str
    word: str
    standard: str
    make: Callable[..., Any]
    options: Mapping[str, Option]
    choices: Mapping[str, tuple[str, Callable[..., Any]]]

    def full(self, keyword: str) -> str:
        """Name of a keyword in the run."""
        return f"{self.name}.{keyword}" if self.name else keyword

    def set_by(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The options that a run has set."""
        return {each: values[self.full(each)] for each in self.options}


def part_of(name: str, kind: str, word: str, default: Callable[..., Any] | str = "") -> Part:
    """The part that a word names.

    Args:
        name: name of the part in the run.
        kind: kind of the catalogue.
        word: word of that kind, or package.module:attribute; "" for the default.
        default: word if nobody chooses, or the default of the keyword that leads here, which may have options of its
            own.

    Raises:
        ValueError: there is no such thing, or a package that it needs is not installed.
    """
    found = named(default) if callable(default) else None
    standard = found[1] if found else default if isinstance(default, str) else ""
    word = word or standard
    return (_read if ":" in word else _READ)(name, kind, word, standard, default)  # a user's own may change


def _read(name: str, kind: str, word: str, standard: str, default: Callable[..., Any] | str) -> Part:
    own = callable(default) and word == standard
    make = default if callable(default) and own else load_word(kind, word)
    fixed = make.keywords if isinstance(make, partial) and not own else {}  # what its word fixes
    free = {each: known.default for each, known in parameters_of(make).items() if each not in fixed}
    options = {each: known for each, known in options_of(make).items() if each in free}
    leads_to = {each: (named(value), value) for each, value in free.items() if each not in options and callable(value)}
    choices = {each: (found[0], value) for each, (found, value) in leads_to.items() if found}
    return Part(name, kind, word, standard or word, make, options, choices)


_READ: Final = cache(_read)


def teaching(algorithm: str, given: Mapping[str, Any], *, asks: bool) -> str:
    """How a learner is taught: the catalogue says it; for one of your own, whether a teacher or teachers were given."""
    if ":" in algorithm:
        return "teachers" if asks else "teacher" if "teacher" in given else ""
    by = TAUGHT_BY.get(algorithm, "")
    return "teacher" if by not in ("", "teachers") else by


def chosen(algorithm: str, given: Mapping[str, Any], *, asks: bool = False) -> dict[str, Part]:
    """Parts of a run by name: first the algorithm and the environment, then those that others lead to.

    Args:
        algorithm: word of the learner.
        given: choices by name; names of no part of this run are passed over.
        asks: true if teachers to ask were given.

    Raises:
        ValueError: see ``part_of``.
    """
    found: dict[str, Part] = {}

    def take(name: str, kind: str, default: Callable[..., Any] | str) -> None:
        part = found[name] = part_of(name, kind, given.get(name, ""), default)
        for keyword, (child, value) in part.choices.items():
            take(part.full(keyword), child, value)

    take("environment", "environment", ROD)
    take(ALGORITHM, "algorithm", algorithm)
    if teaching(algorithm, given, asks=asks) == "teacher":
        take("teacher", "teacher", TAUGHT_BY.get(algorithm, "periodic"))
    return found


def _with(kind: str, name: str) -> list[str]:
    """The words of a kind whose parts have an option, or lead to a part, of this name."""
    found = []
    for word in WORDS.get(kind, {}) if kind != "command" else ():
        with suppress(ValueError):  # one that is not installed has nothing
            part = part_of(ALGORITHM, kind, word)
            if name in (*part.options, *part.choices, teaching(word, {}, asks=False) if kind == "algorithm" else ""):
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
    """Name as the command line spells it."""
    return name.replace("_", "-")


def plain(value: Any) -> Any:
    """Value as json has it."""
    return json.loads(json.dumps(value, default=str))


def typed(value: Any) -> str:
    """Value as one types it."""
    if isinstance(value, tuple):
        return ",".join(map(typed, value)) or "[]"
    return json.dumps(value) if value is None or isinstance(value, bool) else str(value)
