"""Settings of a run: options of the run itself, its parts, and options of the parts.

Defaults are those of the library, so a run with one changed option is an ablation.
    config = Config(algorithm="sagg-riac", parts={"goals.window": 12}); config["search.noise"]
Options of a part are the keywords of its signature (`sgimd_torch.options.signature`). A keyword that is called like a
kind of the catalogue, such as ``goals``, chooses another part. Options of hooks, such as ``until``, have no prefix.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Final, NamedTuple, Self

from sgimd_torch.calls import NO_DEFAULT, parameters_of
from sgimd_torch.options.catalogue import ROD, WORDS, load_word, word_of
from sgimd_torch.options.signature import Option, options_of
from sgimd_torch.texts import as_text, did_you_mean

OWN: Final = "own"  # name of the run's own inverse model
OF_TEACHING: Final = ("demonstrations", "teacher", "social")  # options of taught algorithms
USUAL_TEACHER: Final = {"practice-taught": "at-once"}  # by algorithm; of all others: "periodic"
LEAST: Final = {"seed": 0, "movements": 1, "repeats": 0, "failures": 1, "evaluate_at": 1, "floor_at": 1}
"""Least value of an option, or of each of its numbers."""
MOST_MOVEMENTS: Final = 10**8


@dataclass(frozen=True)
class Config:
    """One run.

    Args:
        algorithm: learner; the default needs no teacher, as an unknown robot has none.
        seed: random seed; two runs with equal options and an equal seed are equal.
        movements: number of movements, rests included.
        out: folder for runs; a run with seed 3 goes to OUT/NAME/seed-003.
        name: name of the variant, NAME in the path of the run; null: the algorithm.
        evaluate_at: numbers of movements after which to evaluate, besides the end; null: 250, 500 and every 1000; []:
            never, not even at the end.
        evaluated_by: inverse models to evaluate: first own, which is the run's, then names for --inverse.
        repeats: number of extra executions of each evaluation movement, for the noise; 0: none.
        floor_at: evaluations that measure noise; null: the last; []: none.
        benchmark: file of goals for evaluations; null: the environment's own.
        demonstrations: file of recorded demonstrations; null: the environment's own.
        failures: number of failed movements in a row that stops the run; null: 10.
        parts: parts and options of parts and hooks by name, such as "goals", "goals.window" or "until"; defaults may be
            left out.

    Raises:
        ValueError: a value is out of its range, or a name is unknown.
    """

    algorithm: str = "practice"
    seed: int = 0
    movements: int = 5000
    out: Path = Path("runs")
    name: str | None = None
    evaluate_at: tuple[int, ...] | None = None
    evaluated_by: tuple[str, ...] = (OWN,)
    repeats: int = 2
    floor_at: tuple[int, ...] | None = None
    benchmark: Path | None = None
    demonstrations: Path | None = None
    failures: int | None = None
    parts: Mapping[str, Any] | tuple[tuple[str, Any], ...] = ()

    def __post_init__(self) -> None:
        given = dict(self.parts)
        for name in given:
            if name not in self.defaults:
                raise self._unknown(name)
        changed = sorted((name, value) for name, value in given.items() if differ(value, self.defaults[name]))
        object.__setattr__(self, "parts", tuple(changed))
        if self.demonstrations is not None and not self.teaching:
            raise self._unknown("demonstrations")
        for name, least in LEAST.items():
            value = getattr(self, name)
            if value is not None and min(value if isinstance(value, tuple) else (value,), default=least) < least:
                raise ValueError(f"{name} must be at least {least}, got {as_text(value)}")
        if self.movements > MOST_MOVEMENTS:
            raise ValueError(f"movements must be at most {MOST_MOVEMENTS}, got {self.movements}")
        if self.repeats == 1:
            raise ValueError("repeats must be 0 or at least 2, got 1; one outcome shows no scatter")
        check_names("evaluated_by", self.evaluated_by)
        if self.evaluated_by[0] != OWN:
            raise ValueError(f"evaluated_by must begin with {OWN}, got {as_text(self.evaluated_by)}")
        if self.variant in ("", ".", "..") or any(sign in self.variant for sign in "/\\\0"):
            raise ValueError(f"name must be the name of one directory, got {self.variant!r}; is it a path for --out?")

    def __getitem__(self, name: str) -> Any:
        """Value of an option in this run, such as "goals.window", or name of a part, such as "goals".

        Raises:
            KeyError: the run has no such option.
        """
        return self.values[name]

    @cached_property
    def chosen(self) -> dict[str, Chosen]:
        """Parts of the run, by name; the run itself is the part ""."""
        return chosen({"algorithm": self.algorithm, **dict(self.parts)})

    @cached_property
    def defaults(self) -> dict[str, Any]:
        """Default of every option, by name."""
        return {name: option.default for name, option in all_options(self.chosen).items()}

    @cached_property
    def values(self) -> dict[str, Any]:
        """Value of every option, by name."""
        return {**self.defaults, **{name: getattr(self, name) for name in RUN}, **dict(self.parts)}

    @property
    def teaching(self) -> str:
        """How the learner is taught: by "teachers" (it asks them), by a "teacher" (who is not asked), or "" (alone)."""
        return teaching(self.chosen["algorithm"].make, self.values)

    def constructor(self, name: str) -> Callable[..., Any]:
        """The constructor of a part, with its options and the constructors of the parts that it chooses."""
        part = self.chosen[name]
        keywords = {
            option.rpartition(".")[2]: self.constructor(option) if option in self.chosen else self.values[option]
            for option in part.options
        }
        return partial(part.make, **keywords)

    def with_found(self, options: Mapping[str, Any]) -> Self:
        """These settings, with options that the robot has found by movements, such as the corners of T."""
        parts = {f"environment.{name}": value for name, value in options.items()}
        return replace(self, parts={**dict(self.parts), **{name: parts[name] for name in parts if name in self.values}})

    @property
    def settings(self) -> dict[str, Any]:
        """Value of every option as a json value; ``from_settings`` makes the run from them."""
        return json.loads(json.dumps(self.values, default=str))

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any], folder: Path = Path()) -> Self:
        """The run with these values by name, as json values or as a user types them; others have their defaults.

        Args:
            settings: values by name.
            folder: folder in which relative paths begin, if something is there; else they begin in the present one.

        Raises:
            ValueError: a value is of another type or out of its range, or an option does not exist.
        """
        values, options = dict(settings), all_options(chosen({"algorithm": cls.algorithm, **settings}))
        for name, value in settings.items():
            wanted = options[name].values if name in options else None
            if isinstance(value, list):
                values[name] = tuple(value)
            elif isinstance(value, str) and wanted is not None:
                try:
                    values[name] = wanted.of(value)
                except ValueError as error:
                    raise ValueError(f"--{dashed(name)} {error}") from error
                if wanted.are_paths and value and os.path.exists(folder / value):
                    values[name] = type(values[name])(folder / value)
        parts = {name: value for name, value in values.items() if name not in RUN}
        return cls(**{name: value for name, value in values.items() if name in RUN}, parts=parts)

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
    def program(self) -> tuple[str, ...]:
        """Program for ``python -c``, and its arguments, that start or resume the run."""
        sgimd = "import sys; from sgimd_torch.__main__ import main; sys.exit(main())"
        return sgimd, "run", "--resume", *words(self)

    @property
    def evaluations(self) -> list[int]:
        """Numbers of movements after which to evaluate, in order."""
        if self.evaluate_at == ():
            return []
        usual = (250, 500, *range(1000, self.movements, 1000))
        wanted = usual if self.evaluate_at is None else self.evaluate_at
        return sorted({movements for movements in wanted if movements < self.movements} | {self.movements})

    def _unknown(self, name: str) -> ValueError:
        """The error for an option that this run does not have."""
        owner = name.rpartition(".")[0]
        part = self.chosen[owner] if owner and owner in self.chosen else self.chosen["algorithm"]
        if name.partition(".")[0] in OF_TEACHING and not self.teaching:
            why = "learns alone; --algorithm sgim-d, for example, is taught"
        else:
            known = sorted(self.defaults.keys() - {name})
            near = did_you_mean(name, [option for option in known if option.rpartition(".")[0] == owner], 2)
            why = f"has no such option{dashed(near)}"
        return ValueError(f"--{dashed(name)}: {part.kind} {part.word} {why}")


RUN: Final = options_of(Config)
"""Options of every run, without those of hooks."""


class Chosen(NamedTuple):
    """A part that a run has chosen.

    Attributes:
        kind: kind of the part, such as "progress".
        word: name of the part in the catalogue, or its reference.
        make: constructor.
        options: options by their names in the run, such as "goals.progress.window"; the default of a part is its name.
    """

    kind: str
    word: str
    make: Callable[..., Any]
    options: Mapping[str, Option]


def teaching(algorithm: Callable[..., Any], given: Mapping[str, Any]) -> str:
    """How a learner is taught: by what its function must be given, or by a teacher where it may have one."""
    fixed = algorithm.keywords if isinstance(algorithm, partial) else {}
    parameters = {name: parameter for name, parameter in parameters_of(algorithm).items() if name not in fixed}
    needed = {name for name, parameter in parameters.items() if parameter.default is NO_DEFAULT}
    if "teachers" in needed:
        return "teachers"
    return "teacher" if "correspondence" in needed or ("correspondence" in parameters and "teacher" in given) else ""


def chosen(given: Mapping[str, Any]) -> dict[str, Chosen]:
    """Parts of a run by name: the run itself, hooks, algorithm, environment, teacher, and what these choose.

    Args:
        given: choices by name, such as "algorithm" or "goals"; other names are ignored.

    Raises:
        ValueError: there is no such part, or a package that it needs is not installed.
    """
    first = {"algorithm": Option(Config.algorithm, part="algorithm"), "environment": Option(ROD, part="environment")}
    algorithm = given.get("algorithm", Config.algorithm)
    if teaching(load_word("algorithm", algorithm), given) == "teacher":
        first["teacher"] = Option(USUAL_TEACHER.get(algorithm, "periodic"), part="teacher")
    parts, waiting = {"": Chosen("run", "run", Config, {**RUN, **first})}, list(first.items())
    for word in WORDS["hook"]:
        hook = load_word("hook", word)
        parts[f"hook {word}"] = Chosen("hook", word, hook, options_of(hook))
    while waiting:
        name, (default, _, kind) = waiting.pop(0)
        usual = default if isinstance(default, str) else word_of(kind, default)
        word = given.get(name, usual)
        make = default if callable(default) and word == usual else load_word(kind, word)
        fixed = make.keywords if isinstance(make, partial) and make is not default else {}  # those that the word fixes
        prefix = "" if name == "algorithm" else f"{name}."
        options, choices = {}, []
        for keyword, option in options_of(make).items():
            own = prefix + keyword
            if keyword in fixed or own in RUN:  # an option of the run hides an option of the algorithm
                continue
            options[own] = option
            if option.part:
                options[own] = Option(word_of(option.part, option.default), part=option.part)
                choices.append((own, option))
        parts[name] = Chosen(kind, word, make, options)
        waiting[:0] = choices
    return parts


def all_options(parts: Mapping[str, Chosen]) -> dict[str, Option]:
    """Options of a run with these parts, by name."""
    return {name: option for part in parts.values() for name, option in part.options.items()}


def words(config: Config) -> list[str]:
    """Arguments of ``sgimd run`` for a run: ``--dashed-name=value`` for the algorithm and each changed option."""
    changed = {name: value for name, value in config.values.items() if differ(value, config.defaults[name])}
    return [f"--{dashed(name)}={as_text(value)}" for name, value in ({"algorithm": config.algorithm} | changed).items()]


def check_names(option: str, names: tuple[str, ...]) -> None:
    """Refuse an option without names, or with a name twice.

    Raises:
        ValueError: it is such an option.
    """
    if not names or len({*names}) < len(names):
        raise ValueError(f"{option} must have at least one name, and each only once, got {as_text(names)}")


def differ(one: Any, other: Any) -> bool:
    """Whether two values of an option differ; NaN does not differ from NaN."""
    return bool(one != other and (one == one or other == other))


def dashed(name: str) -> str:
    """Name of an option as the command line spells it."""
    return name.replace("_", "-")
