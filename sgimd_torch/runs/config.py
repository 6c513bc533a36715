"""Settings of a run: options of the run itself, its parts, and options of the parts.

Defaults are those of the library, so a run with one changed option is an ablation.
    config = Config(algorithm="sagg-riac", parts={"goals": "grid", "goals.window": 12}); config["search.noise"]
Options of a part are the keywords of its signature (`sgimd_torch.catalogue.options`). A keyword whose default is in the
catalogue chooses another part.
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

OWN: Final = "own"  # name of the run's own inverse model
FILES: Final = ("benchmark", "demonstrations")  # options that name a file
THREADS: Final = "environment.threads"
PLACE: Final = ("seed", "out", "name", "board", THREADS)  # seed, place, display and speed of a run
EVALUATES: Final = ("evaluated_by", "repeats", "floor_at", "benchmark_crc32")  # equal options of all evaluations
MAY_CHANGE: Final = (
    *("movements", "out", "name", "board", "failures", "evaluate_at"),
    *(*FILES, *EVALUATES, THREADS),
)
"""Options that may change when a run is resumed, as they do not affect the learner. Files are compared by their
checksums: the demonstrations must be equal, the benchmark may be another one."""
ALGORITHM: Final = ""  # name of the part "algorithm" of a run: its options have no prefix


@dataclass(frozen=True)
class Config:
    """One run.

    Args:
        algorithm: learner, see below; the default is practice for a robot without demonstrations.
        seed: random seed; two runs with equal options and an equal seed are equal.
        movements: number of movements, rests included.
        teachers: names of teachers for an algorithm that asks; null: one teacher with all demonstrations.
        out: folder for runs; a run with seed 3 goes to OUT/NAME/seed-003.
        name: name of the variant, NAME in the path of the run; null: the name of the algorithm.
        board: true to write curves and pictures for TensorBoard into the run's folder.
        evaluate_at: numbers of movements after which to evaluate, besides the end; null: 250, 500 and every 1000; []:
            never, not even at the end.
        evaluated_by: inverse models to evaluate: first own, which is the run's, then names for --inverse.
        repeats: number of extra executions of each evaluation movement, to measure the noise; 0: no measurement.
        floor_at: numbers of movements at which the evaluation also measures the noise, which takes four times as long;
            null: every evaluation.
        benchmark: file of goals for evaluations; null: the environment's own goals.
        demonstrations: file of recorded demonstrations; null: the environment's own demonstrations.
        failures: number of failed movements in a row that stops the run; null: 10.
        parts: parts and their options by name, such as "goals" or "goals.window"; defaults may be left out.

    Raises:
        ValueError: a value is out of its range, or a name is unknown.
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
            raise ValueError("repeats must be 0 or at least 2, got 1; one outcome shows no scatter")
        for name in ("evaluate_at", "floor_at"):
            if min(getattr(self, name) or (1,)) < 1:
                raise ValueError(f"{name} must be numbers of movements, at least 1, got {getattr(self, name)}")
        for name in ("evaluated_by", "teachers"):
            words = getattr(self, name)
            if words is not None and (not words or len({*words}) < len(words)):
                raise ValueError(f"{name} must have at least one name, and each only once, got {','.join(words)}")
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
            raise ValueError(f"name must be the name of one directory, got {self.variant!r}; is it a path for --out?")

    def __getitem__(self, name: str) -> Any:
        """Value of an option or a part in this run, such as "goals.window".

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
        """How the learner is taught: by "teachers" (it asks them), by a "teacher" (who is not asked), or "" (alone)."""
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
        """Values of every part and every option of a part, by name."""
        return {**self.standards, **dict(self.parts)}

    @property
    def settings(self) -> dict[str, Any]:
        """All options of this run as json values; ``from_settings`` makes the run from them."""
        return plain({**self.values, **{name: getattr(self, name) for name in RUN}})

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """The run with these ``settings``; missing settings have their defaults.

        Raises:
            ValueError: a value is out of its range, or an option does not exist.
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
        """The error for an option that this run does not have; the message names parts that have it."""
        owner, _, last = name.rpartition(".")
        if owner not in self.chosen:  # the part with this option does not belong to this run, either
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
"""Options of every run."""
FLAGS: Final = {
    "resume": "flag: go on with a stopped or killed run, or lengthen a finished one.",
    "accept_loss": "flag, with --resume: go on from the damage in a damaged record; a copy of the file is kept.",
}


@dataclass(frozen=True)
class Part:
    """A part of a run.

    Args:
        name: name of the part in the run, such as "goals" or "goals.progress".
        kind: kind of the part, such as "goals" or "progress".
        word: name of the chosen part in the catalogue.
        standard: name of the default part in the catalogue.
        make: constructor, with the keywords that the name in the catalogue fixes.
        options: keywords that a run can set.
        choices: keywords that choose other parts, with the kind and the default of each.
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
        """Options of this part, from the ``values`` of a run."""
        return {each: values[self.full(each)] for each in self.options}


def part_of(name: str, kind: str, word: str, default: Callable[..., Any] | str = "") -> Part:
    """The part that ``word`` names.

    Args:
        name: name of the part in the run.
        kind: kind of the part.
        word: name in the catalogue, or package.module:attribute; "": the default part.
        default: name of the default part, or its constructor, which may fix options.

    Raises:
        ValueError: there is no such part, or a package that it needs is not installed.
    """
    found = named(default) if callable(default) else None
    standard = found[1] if found else default if isinstance(default, str) else ""
    word = word or standard
    return (_read if ":" in word else _READ)(name, kind, word, standard, default)  # no cache for a user's file


def _read(name: str, kind: str, word: str, standard: str, default: Callable[..., Any] | str) -> Part:
    own = callable(default) and word == standard
    make = default if callable(default) and own else load_word(kind, word)
    fixed = make.keywords if isinstance(make, partial) and not own else {}  # keywords that its name fixes
    free = {each: known.default for each, known in parameters_of(make).items() if each not in fixed}
    options = {each: known for each, known in options_of(make).items() if each in free}
    leads_to = {each: (named(value), value) for each, value in free.items() if each not in options and callable(value)}
    choices = {each: (found[0], value) for each, (found, value) in leads_to.items() if found}
    return Part(name, kind, word, standard or word, make, options, choices)


_READ: Final = cache(_read)


def teaching(algorithm: str, given: Mapping[str, Any], *, asks: bool) -> str:
    """How a learner is taught: as the catalogue says, or, for a user's own learner, by whoever was given."""
    if ":" in algorithm:
        return "teachers" if asks else "teacher" if "teacher" in given else ""
    by = TAUGHT_BY.get(algorithm, "")
    return "teacher" if by not in ("", "teachers") else by


def chosen(algorithm: str, given: Mapping[str, Any], *, asks: bool = False) -> dict[str, Part]:
    """Parts of a run by name: environment, algorithm, and the parts that these choose.

    Args:
        algorithm: name of the learner.
        given: choices by name; other names are ignored.
        asks: whether the run has teachers to ask.

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
    """Names of the parts of a kind that have an option or a choice with this ``name``."""
    found = []
    for word in WORDS.get(kind, {}) if kind != "command" else ():
        with suppress(ValueError):  # parts that are not installed are left out
            part = part_of(ALGORITHM, kind, word)
            if name in (*part.options, *part.choices, teaching(word, {}, asks=False) if kind == "algorithm" else ""):
                found.append(word)
    return found


def code_of(settings: Mapping[str, Any]) -> list[str]:
    """Places ``package.module:attribute`` in ``settings`` that are a user's own code."""
    values = [value for name, value in settings.items() if name not in (*PLACE, *FILES)]
    words = [word for value in values for word in (value if isinstance(value, list) else [value])]
    return sorted({w for w in words if isinstance(w, str) and ":" in w and not w.startswith("sgimd_torch.")})


def words(config: Config) -> list[str]:
    """Arguments of ``sgimd run`` for a run: ``--dashed-name=value`` for the algorithm and each changed option."""
    standard = {each.name: each.default for each in fields(Config)}
    own = [
        (name, getattr(config, name)) for name in RUN if getattr(config, name) != standard[name] or name == "algorithm"
    ]
    return [f"--{dashed(name)}={typed(value)}" for name, value in (*own, *dict(config.parts).items())]


def dashed(name: str) -> str:
    """Name of an option as the command line spells it."""
    return name.replace("_", "-")


def plain(value: Any) -> Any:
    """Value of an option as a json value."""
    return json.loads(json.dumps(value, default=str))


def typed(value: Any) -> str:
    """Value of an option as a user types it."""
    if isinstance(value, tuple):
        return ",".join(map(typed, value)) or "[]"
    return json.dumps(value) if value is None or isinstance(value, bool) else str(value)
