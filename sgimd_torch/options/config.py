"""Settings of a run: options of the run itself, its parts, and options of the parts.

Defaults are those of the library, so a run with one changed option is an ablation.
    config = Config(algorithm="sagg-riac", parts={"goals.window": 12}); config["search.noise"]
Options of a part are the keywords of its signature (`sgimd_torch.options.signature`). A keyword that is called like a
kind of the catalogue, such as ``goals``, chooses another part.
"""

from __future__ import annotations

import importlib.util
import json
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Final, NamedTuple, Self

from sgimd_torch.options.catalogue import PLACES, ROD, TAUGHT_BY, WORDS, did_you_mean, load_word, place_of, word_of
from sgimd_torch.options.signature import Option, choices_of, options_of, parameters_of

OWN: Final = "own"  # name of the run's own inverse model
FILES: Final = ("benchmark", "demonstrations", "begin_with")  # options that name a file
THREADS: Final = "environment.threads"
PLACE: Final = ("seed", "out", "name", "board", THREADS)  # seed, place, display and speed of a run
EVALUATES: Final = ("evaluated_by", "repeats", "floor_at", "benchmark_crc32")  # equal options of all evaluations
MAY_CHANGE: Final = (
    *("movements", "until", "out", "name", "board", "failures", "evaluate_at"),
    *(*FILES, *EVALUATES, THREADS),
)
"""Options that may change when a run is resumed, as they do not affect the learner. Files are compared by their
checksums: the demonstrations must be equal, the benchmark may be another one."""
OF_TEACHING: Final = ("demonstrations", "teacher", "teachers", "social")  # options of taught algorithms
ALGORITHM: Final = ""  # name of the part "algorithm" of a run: its options have no prefix


@dataclass(frozen=True)
class Config:
    """One run.

    Args:
        algorithm: learner, see below.
        seed: random seed; two runs with equal options and an equal seed are equal.
        movements: number of movements, rests included.
        until: mean error (unit of T) that ends the run once it is expected; null: none.
        teachers: names of teachers to ask; null: one with all demonstrations.
        out: folder for runs; a run with seed 3 goes to OUT/NAME/seed-003.
        name: name of the variant, NAME in the path of the run; null: the algorithm.
        board: true to write curves and pictures for TensorBoard into the run's folder.
        evaluate_at: numbers of movements after which to evaluate, besides the end; null: 250, 500 and every 1000; []:
            never, not even at the end.
        evaluated_by: inverse models to evaluate: first own, which is the run's, then names for --inverse.
        repeats: number of extra executions of each evaluation movement, for the noise; 0: none.
        floor_at: evaluations that measure noise; null: the last; []: none.
        benchmark: file of goals for evaluations; null: the environment's own.
        demonstrations: file of recorded demonstrations; null: the environment's own.
        begin_with: run.sqlite or csv of another robot or simulator to begin with; null: none.
        failures: number of failed movements in a row that stops the run; null: 10.
        at_once: number of robots that move at once; after each 30 movements one more robot joins.
        parts: parts and their options by name, such as "goals" or "goals.window"; defaults may be left out.

    Raises:
        ValueError: a value is out of its range, or a name is unknown.
    """

    algorithm: str = "practice"
    seed: int = 0
    movements: int = 5000
    until: float | None = None
    teachers: tuple[str, ...] | None = None
    out: Path = Path("runs")
    name: str | None = None
    board: bool = False
    evaluate_at: tuple[int, ...] | None = None
    evaluated_by: tuple[str, ...] = (OWN,)
    repeats: int = 2
    floor_at: tuple[int, ...] | None = None
    benchmark: Path | None = None
    demonstrations: Path | None = None
    begin_with: Path | None = None
    failures: int | None = None
    at_once: int = 1
    parts: Mapping[str, Any] | tuple[tuple[str, Any], ...] = ()

    def __post_init__(self) -> None:
        given = dict(self.parts)
        for name in given:
            if name not in self.standards:
                raise self._refused(name)
        differing = sorted((name, value) for name, value in given.items() if differ(value, self.standards[name]))
        object.__setattr__(self, "parts", tuple(differing))
        for name, least in (("seed", 0), ("movements", 1), ("repeats", 0), ("failures", 1), ("at_once", 1)):
            value = getattr(self, name)
            if value is not None and value < least:
                raise ValueError(f"{name} must be at least {least}, got {value}")
        if self.until is not None and not 0 < self.until < math.inf:
            raise ValueError(f"until must be an error above 0, in the unit of T, got {self.until}")
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
        if self.demonstrations is not None and not self.teaching:
            raise self._refused("demonstrations")
        if self.begin_with is not None and "prior" not in parameters_of(self.chosen[ALGORITHM].make):
            raise ValueError(f"--begin-with: algorithm {self.algorithm} does not learn from another robot")
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
        return chosen(self._choices)

    @property
    def teaching(self) -> str:
        """How the learner is taught: by "teachers" (it asks them), by a "teacher" (who is not asked), or "" (alone)."""
        return teaching(self._choices)

    @property
    def _choices(self) -> dict[str, Any]:
        return {"algorithm": self.algorithm, "teachers": self.teachers, **dict(self.parts)}

    @cached_property
    def standards(self) -> dict[str, Any]:
        """Defaults of every part and every option of a part, by name."""
        found = {name: part.standard for name, part in self.chosen.items() if name != ALGORITHM}
        return found | {name: each.default for part in self.chosen.values() for name, each in part.options.items()}

    @cached_property
    def values(self) -> dict[str, Any]:
        """Values of every part and every option of a part, by name."""
        return {**self.standards, **dict(self.parts)}

    def constructor(self, name: str) -> Callable[..., Any]:
        """The constructor of a part, with its options and the constructors of the parts that it chooses."""
        part = self.chosen[name]
        given = {each: self.values[each] for each in part.options}
        given |= {each: self.constructor(each) for each in part.choices}
        return partial(part.make, **{each.rpartition(".")[2]: value for each, value in given.items()})

    @property
    def settings(self) -> dict[str, Any]:
        """All options of this run as json values; ``from_settings`` makes the run from them."""
        return as_json({**self.values, **{name: getattr(self, name) for name in RUN}})

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """The run with these ``settings``; missing settings have their defaults.

        Raises:
            ValueError: a value is out of its range, or an option does not exist.
        """
        own = dict(settings)
        own |= {name: tuple(value) for name, value in own.items() if isinstance(value, list)}
        own |= {name: Path(own[name]) for name in ("out", *FILES) if own.get(name) is not None}
        parts = {name: value for name, value in own.items() if name not in RUN}
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

    def due(self, movements: int, numbers: Iterable[int]) -> bool:
        """Whether one of ``numbers`` falls into the group of robots that ended after this number of ``movements``."""
        return any(0 <= movements - each < self.at_once for each in numbers)

    @property
    def floors(self) -> tuple[int, ...]:
        """Numbers of movements at which an evaluation measures the noise."""
        return (self.movements,) if self.floor_at is None else self.floor_at

    def _refused(self, name: str) -> ValueError:
        """The error for an option that this run does not have."""
        owner = name.rpartition(".")[0]
        part = self.chosen.get(owner, self.chosen[ALGORITHM])
        if name.partition(".")[0] in OF_TEACHING and not self.teaching:
            why = f"learns alone; taught are {', '.join(TAUGHT_BY)}"
        else:
            known = {*self.standards, *RUN, *FLAGS} - {name}
            near = did_you_mean(name, [each for each in sorted(known) if each.rpartition(".")[0] == owner], 2)
            why = f"has no such option{dashed(near)}"
        return ValueError(f"--{dashed(name)}: {part.kind} {part.word} {why}")


RUN: Final = options_of(Config)
"""Options of every run."""
FLAGS: Final = {
    "resume": "flag: go on with a stopped or killed run, or lengthen a finished one.",
    "accept_loss": "flag, with --resume: go on from the damage in a damaged record; a copy of the file is kept.",
}


class Part(NamedTuple):
    """A part of a run.

    Attributes:
        kind: kind of the part, such as "progress".
        word: name of the chosen part in the catalogue.
        standard: name of the default part in the catalogue.
        make: constructor.
        options: keywords that a run can set, by name in the run, such as "goals.progress.window".
        choices: constructors of the default parts that it chooses, by name in the run, such as "goals.progress".
    """

    kind: str
    word: str
    standard: str
    make: Callable[..., Any]
    options: Mapping[str, Option]
    choices: Mapping[str, Callable[..., Any]]


def teaching(given: Mapping[str, Any]) -> str:
    """How a learner is taught: as the catalogue says, or, for a user's own learner, by whoever was given."""
    if ":" in given["algorithm"]:
        return "teachers" if given.get("teachers") else "teacher" if "teacher" in given else ""
    by = TAUGHT_BY.get(given["algorithm"], "")
    return by if by in ("", "teachers") else "teacher"


def chosen(given: Mapping[str, Any]) -> dict[str, Part]:
    """Parts of a run by name: environment, algorithm, teacher, and the parts that these choose.

    Args:
        given: choices by name, such as "algorithm" or "goals"; other names are ignored.

    Raises:
        ValueError: there is no such part, or a package that it needs is not installed.
    """
    found: dict[str, Part] = {}

    def take(name: str, kind: str, default: Callable[..., Any] | str) -> None:
        standard = word_of(kind, default) if callable(default) else default
        word = given.get(name) or standard
        if callable(default) and word == standard:
            make, fixed = default, dict[str, Any]()
        else:
            make = load_word(kind, word)
            fixed = make.keywords if isinstance(make, partial) else {}  # keywords that the word fixes
        prefix = f"{name}." if name else ""
        options = {prefix + each: option for each, option in options_of(make).items() if each not in fixed}
        choices = {prefix + each: value for each, value in choices_of(make).items() if each not in fixed}
        found[name] = Part(kind, word, standard, make, options, choices)
        for each, value in choices.items():
            take(each, each.removeprefix(prefix), value)

    take("environment", "environment", ROD)
    take(ALGORITHM, "algorithm", given["algorithm"])
    if teaching(given) == "teacher":
        take("teacher", "teacher", TAUGHT_BY.get(given["algorithm"], "periodic"))
    return found


def code_of(settings: Mapping[str, Any]) -> list[str]:
    """Places ``package.module:attribute`` in ``settings`` that are a user's own code."""
    chosen = [value for name, value in settings.items() if name.rpartition(".")[2] in (*WORDS, "evaluated_by")]
    words = [word for value in chosen for word in (value if isinstance(value, list) else [value])]
    return sorted({w for w in words if isinstance(w, str) and ":" in w and w not in PLACES})


def words(config: Config) -> list[str]:
    """Arguments of ``sgimd run`` for a run: ``--dashed-name=value`` for the algorithm and each changed option."""
    own = {name: getattr(config, name) for name in RUN}
    own = {name: value for name, value in own.items() if value != RUN[name].default or name == "algorithm"}
    return [f"--{dashed(name)}={as_text(value)}" for name, value in {**own, **dict(config.parts)}.items()]


def differ(one: Any, other: Any) -> bool:
    """Whether two values of an option differ; NaN does not differ from NaN."""
    return bool(one != other and (one == one or other == other))


def dashed(name: str) -> str:
    """Name of an option as the command line spells it."""
    return name.replace("_", "-")


def as_json(value: Any) -> Any:
    """Value of an option as a json value."""
    return json.loads(json.dumps(value, default=str))


def as_text(value: Any) -> str:
    """Value of an option as a user types it."""
    if isinstance(value, tuple):
        return ",".join(map(as_text, value)) or "[]"
    return json.dumps(value) if value is None or isinstance(value, bool) else str(value)
