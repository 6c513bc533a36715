"""What a run is made of: one field for each option, with all that is known about it.

Each default is the library's own; a run with one changed option is an ablation.
    config = Config(algorithm="sagg-riac", goals="uniform", name="uniform-goals"); config.directory
An option is added here, by one field, and nowhere else.
"""

from __future__ import annotations

import importlib.util
import json
import math
import os
from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields
from pathlib import Path
from typing import Any, Final, NamedTuple

from sgimd_torch.catalogue import CATALOGUE, ROD, SHARED, Entry, find


class Option(NamedTuple):
    """What is known about a field of ``Config``.

    ``about`` is its line in ``--help``, under the heading ``group``. Its numbers are from ``least`` to ``most`` and
    greater than ``above``; ``slip`` ends the error. ``on_resume``: it may change when a run is resumed, because it only
    says how long the run lasts, where it is or how it is shown. ``place``: it does not change the learner.
    ``evaluates``: all evaluations of a run share it. ``leads``: one of the few that a comparison shows first.
    ``standard``: what null becomes, unless the algorithm has a value of its own, see ``Entry``.
    """

    about: str
    group: str
    least: float = -math.inf
    most: float = math.inf
    above: float = -math.inf
    slip: str = ""
    on_resume: bool = False
    place: bool = False
    evaluates: bool = False
    leads: bool = False
    standard: Any = None

    def check(self, name: str, value: Any) -> None:
        """Refuse the first number that is out of bounds.

        Raises:
            ValueError: with the bounds.
        """
        for number in value if isinstance(value, tuple) else (value,):
            if isinstance(number, int | float) and not (
                self.least <= number <= self.most and number > self.above and number < math.inf
            ):
                raise ValueError(
                    f"{name} must be {self._bounds(type(number))}, got {number}{self.slip and f'; {self.slip}'}"
                )

    def _bounds(self, kind: type) -> str:
        least, most, above = (f"{bound:g}".replace("e+0", "e") for bound in (self.least, self.most, self.above))
        if self.above > -math.inf:
            return f"above {above}" + (f" and at most {most}" if self.most < math.inf else "")
        if self.most < math.inf:
            return f"from {least} to {most}" if self.least > -math.inf else f"at most {most}"
        return f"at least {least}" if kind is int else f"finite and at least {least}"


def option(default: Any, group: str, about: str, *, before: Any = ..., **more: Any) -> Any:
    """A field of ``Config``, see ``Option``; ``before`` is the value in runs that are older than the option."""
    return field(default=default, metadata={"option": Option(about, group, **more), "before": before})


RUN, ROBOT, LEARNER, MODEL, TEACHER, EVALUATION = (
    "The run",
    "The robot",
    "The learner",
    "The forward model (extra forward)",
    "The teacher",
    "Evaluation",
)
OWN: Final = "own"  # the answer of the inverse model that a run chose
FILES: Final = ("benchmark", "demonstrations")  # options that name a file
_MOST_THREADS: Final = max(64, os.cpu_count() or 1)


@dataclass(frozen=True)
class Config:
    """One run. ``options()`` explains each field; wrong values raise ValueError."""

    algorithm: str = option("practice-taught", RUN, "Which algorithm learns.", leads=True)
    seed: int = option(0, RUN, "Seed of all random streams; the same seed gives the same files.", least=0, place=True)
    movements: int = option(
        5000, RUN, "Number of movements, those at rest included.", least=1, on_resume=True, leads=True
    )
    out: Path = option(
        Path("runs"), RUN, "Directory for runs; this one goes to OUT/NAME/seed-003.", on_resume=True, place=True
    )
    name: str | None = option(
        None,
        RUN,
        "NAME in that path, to keep a variant apart; null is the algorithm's name.",
        on_resume=True,
        place=True,
    )
    board: bool = option(
        False,
        RUN,
        "Show the run in TensorBoard; sgimd watch OUT opens it. This does not change the run.",
        on_resume=True,
        place=True,
    )
    environment: str = option(ROD, ROBOT, "Which robot in which world.", before=ROD)
    noise: float = option(
        0.032, ROBOT, "Motor noise (s): deviation (rad) of a command for each rad/s of commanded speed.", least=0
    )
    task_space: float = option(
        1.0,
        ROBOT,
        "Half the side (m) of the square that goals come from; 100 in the paper's large-space experiment.",
        above=0,
        most=1e6,
        slip="it is a length in metres",
    )
    threads: int = option(
        1,
        ROBOT,
        "Threads that an evaluation may use; results do not depend on it.",
        least=1,
        most=_MOST_THREADS,
        on_resume=True,
        place=True,
    )
    goals: str | None = option(
        None, LEARNER, "Where goals come from (learners that pursue goals).", leads=True, standard="interest-map"
    )
    window: int = option(
        24, LEARNER, "Competences of a region that its interest is measured over, the paper's zeta; even."
    )
    progress: str = option("gained", LEARNER, "What makes a region interesting.")
    g_max: int = option(30, LEARNER, "Goals above which a region is cut in two (interest-map).", least=4, before=30)
    max_aspect: float = option(
        5.0,
        LEARNER,
        "How many times longer than another side a region's side may become; 1e9 is no bound, as in the paper.",
        least=1,
        before=5.0,
    )
    competence: str = option("memory", LEARNER, "What the competence at a goal is judged by.")
    search: str | None = option(
        None, LEARNER, "How a movement is refined (learners that pursue goals).", leads=True, standard="nelder-mead"
    )
    budget: int | None = option(None, LEARNER, "Movements for one goal, at most.", least=1, standard=15)
    give_up: float = option(
        -0.5,
        LEARNER,
        "Competence below which a goal is given up at the first movement in vain; -1 never gives up, as in the paper.",
        least=-1,
        most=0,
        before=-0.5,
    )
    inverse: str = option(
        "process",
        LEARNER,
        "Which movement is inferred for a goal, when learning and in evaluations.",
        leads=True,
    )
    members: int = option(3, MODEL, "Number of networks.", least=1, most=100, slip="5 are many", before=3)
    noise_heads: bool = option(True, MODEL, "Whether its noise depends on the movement.", before=True)
    training: float = option(
        0.3,
        MODEL,
        "Steps of training for each movement; 0.3 takes about a fifth of the rod's physics.",
        above=0,
        most=100,
        slip="it is a number of steps per movement",
        before=0.3,
    )
    focus: float = option(
        0.0,
        MODEL,
        "Share of training drawn from what landed near the goal pursued.",
        least=0,
        most=0.75,
        slip="the rest is for new and old movements",
        before=0.0,
    )
    anchored: bool = option(True, MODEL, "Whether predictions are corrected by its errors nearby.", before=True)
    residual: bool = option(
        True, MODEL, "Whether also by the outcomes of the current search (gradient searches).", before=True
    )
    social: str = option("imitate", TEACHER, "How sgim-d answers a demonstration.")
    imitations: int = option(10, TEACHER, "Movements that sgim-d spends on imitating a demonstration.", least=1)
    epsilon: float = option(
        0.05,
        TEACHER,
        "Bound of the variation in each parameter of theta when imitating.",
        least=0,
        most=1,
        slip="the box of theta is 1 wide",
    )
    teacher: str | None = option(
        None, TEACHER, "When demonstrations come (learners that are shown something).", standard="periodic"
    )
    every: int | None = option(
        None,
        TEACHER,
        "Movements from one demonstration to the next, or from one look at the learner to the next (asked); null is "
        "the default of that teacher.",
        least=1,
    )
    choice: str = option("least-explored", TEACHER, "Which demonstration comes (periodic, asked).")
    teachers: tuple[str, ...] = option(
        ("all",),
        TEACHER,
        "Who can be asked to show a goal (sgim-im: one, sgim-acts: several), such as low-half,high-half.",
        before=["all"],  # as json has it
    )
    base: str = option(
        "practice",
        TEACHER,
        "What those who ask do on their own, and how they imitate (sgim-im, sgim-acts, sgim-eer).",
        before="search",
    )
    cost: float = option(
        1.0,
        TEACHER,
        "Cost of a demonstration that was asked for; the learner's interest in asking is divided by it.",
        above=0,
        most=1e6,
        slip="an attempt of its own costs 1",
        before=1.0,
    )
    patience: float | None = option(
        None,
        TEACHER,
        "Seconds to wait for the answer of a teacher who is asked; null waits for as long as it takes.",
        above=0,
        on_resume=True,
        before=None,
    )
    demonstrations: Path | None = option(
        None, TEACHER, "File of recorded demonstrations; null is the environment's own.", on_resume=True
    )
    evaluate_at: tuple[int, ...] | None = option(
        None,
        EVALUATION,
        "Movements after which to evaluate, besides the end, such as 250,500; null is 250, 500 and every 1000; [] "
        "never evaluates. Evaluating changes nothing in the run.",
        least=1,
        on_resume=True,
    )
    answers: tuple[str, ...] = option(
        ("own", "linear"),
        EVALUATION,
        "Which inverse models answer in evaluations, each with the same noise: own is that of --inverse, others are "
        "its choices, to compare learners by the same one; model answers only in runs that learn one.",
        on_resume=True,
        evaluates=True,
        before=["own"],  # as json has it
    )
    repeats: int = option(
        3,
        EVALUATION,
        "How often each chosen movement is executed again to measure the noise, at least 2; 0 does not measure it.",
        least=0,
        on_resume=True,
        evaluates=True,
    )
    floor_at: tuple[int, ...] | None = option(
        None,
        EVALUATION,
        "Which evaluations measure the noise, such as 1000,5000; it takes ten times as long as the error. null is all.",
        least=1,
        on_resume=True,
        evaluates=True,
    )
    benchmark: Path | None = option(
        None, EVALUATION, "File of the goals to evaluate on; null is the environment's own.", on_resume=True
    )

    def __post_init__(self) -> None:
        find("algorithm", self.algorithm)
        for each in fields(self):
            if getattr(self, each.name) is None:  # now, so that config.json holds what was run
                object.__setattr__(self, each.name, default(each, self.algorithm))
            value = getattr(self, each.name)
            for word in value if isinstance(value, tuple) else (value,):
                if each.name in CATALOGUE:
                    find(each.name, word)
            each.metadata["option"].check(each.name, value)
        for answer in self.answers:
            if answer != OWN:
                find("inverse", answer)
        if self.answers[:1] != (OWN,) or len({*self.answers}) < len(self.answers):
            raise ValueError(f"answers must begin with {OWN} and name each once, got {','.join(self.answers)}")
        if not self.teachers or len({*self.teachers}) < len(self.teachers):
            raise ValueError(f"teachers must name at least one, and each once, got {','.join(self.teachers)}")
        if self.repeats == 1:
            raise ValueError("repeats must be 0 or at least 2, got 1; one landing point does not scatter")
        if self.board and importlib.util.find_spec("tensorboard") is None:
            raise ValueError("board true needs tensorboard, which is not installed; pip install 'sgimd-torch[board]'")
        if self.variant in ("", ".", "..") or any(sign in self.variant for sign in "/\\\0"):
            raise ValueError(f"name must be that of one directory, got {self.variant!r}; is the path for --out?")

    @property
    def settings(self) -> dict[str, Any]:
        """All options, as json has them."""
        return plain(vars(self))

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
        chosen = standard if self.evaluate_at is None else self.evaluate_at
        return sorted({movements for movements in chosen if movements < self.movements} | {self.movements})

    @property
    def answered(self) -> list[str]:
        """The answers that its evaluations have: without a forward model, none by a model."""
        needing = {"model"} - self.used
        options = {answer: find("inverse", answer).options for answer in self.answers if answer != OWN}
        return [answer for answer in self.answers if not needing.intersection(options.get(answer, ()))]

    def entry(self, kind: str) -> Entry:
        """The record of the choice of a kind, or of a shared part."""
        return self.entries(kind)[0]

    def entries(self, kind: str) -> list[Entry]:
        """The same where several may be chosen."""
        return [SHARED[kind]] if kind in SHARED else [find(kind, word) for word in self.choices(kind)]

    def choices(self, kind: str) -> tuple[str, ...]:
        """The choices of a kind: several teachers, one of everything else."""
        value = getattr(self, kind)
        return value if isinstance(value, tuple) else (value,)

    @property
    def used(self) -> set[str]:
        """Options and shared parts that have an effect in this run."""
        waiting, used, ignored = ["algorithm", "environment", "inverse"], set[str](), set[str]()
        while waiting:
            name = waiting.pop()
            used.add(name)
            entries = self.entries(name) if name in CATALOGUE or name in SHARED else []
            for entry in entries:
                ignored |= {option for option in entry.ignores if all(option in each.ignores for each in entries)}
                waiting += [each for each in entry.options if each not in used]
        entries = [*SHARED.values(), *(entry for entries in CATALOGUE.values() for entry in entries.values())]
        named = {each for entry in entries for each in entry.options}
        return (used | {each.name for each in fields(self)} - named) - ignored

    @property
    def own(self) -> list[str]:
        """The things of a user's own in this run, ``package.module:attribute``."""
        used = [word for kind in CATALOGUE if kind in self.used for word in self.choices(kind)]
        return sorted({word for word in (*used, *self.answered) if ":" in word})

    @property
    def uses_model(self) -> bool:
        """Whether a forward model is learnt."""
        return "model" in self.used

    @property
    def without_effect(self) -> list[str]:
        """A note for each option that is not at its default but changes nothing in this run."""
        used = self.used
        changed = [each.name for each in fields(self) if getattr(self, each.name) != default(each, self.algorithm)]
        return [f"--{dashed(name)} has no effect {self._why_not(name, used)}" for name in changed if name not in used]

    def _why_not(self, name: str, used: set[str]) -> str:
        """The choice because of which an option has no effect."""
        if name in SHARED:
            return "without a forward model, see --search and --inverse"
        if name in self.entry("algorithm").ignores:
            return f"on {self.algorithm}, which pursues no goals"
        users = [kind for kind, entries in CATALOGUE.items() if any(name in each.options for each in entries.values())]
        users += [kind for kind, entry in SHARED.items() if name in entry.options]
        chosen = [kind for kind in users if kind in used]
        others = [kind for kind in chosen if kind != "algorithm"]
        if "algorithm" in chosen and name not in self.entry("algorithm").options:
            if not others:
                return f"on {self.algorithm}"
            chosen = others
        elif "algorithm" in chosen:  # it would be used, if another choice did not ignore it
            chosen = [kind for kind in used & CATALOGUE.keys() if name in self.entry(kind).ignores]
        if chosen:
            return f"with --{dashed(chosen[0])} {getattr(self, chosen[0])}"
        return self._why_not(users[0], used)


def default(each: Field[Any], algorithm: str) -> Any:
    """What an option is when nobody sets it, with this algorithm."""
    standard = each.metadata["option"].standard if each.default is None else each.default
    entry = CATALOGUE["algorithm"].get(algorithm)
    return standard if entry is None else entry.own.get(each.name, standard)


def words(settings: Mapping[str, Any]) -> list[str]:
    """The command line of ``sgimd run`` for these settings, of ``vars(config)`` or of a config.json.

    ``--dashed-name=value`` for every option that is not at its default.
    """
    found = []
    for each in fields(Config):
        standard = plain(default(each, settings.get("algorithm", Config.algorithm)))
        value = plain(settings.get(each.name, standard))
        if value not in (standard, plain(each.default)):
            text = value if isinstance(value, str) else json.dumps(value, separators=(",", ":"))
            found.append(f"--{dashed(each.name)}={text}")
    return found


def from_settings(settings: Mapping[str, Any]) -> Config:
    """The choices of a run, from its config.json; options that it lacks did not exist yet.

    Raises:
        ValueError: they make no sense.
    """
    values: dict[str, Any] = {}
    for each in fields(Config):
        if each.name in settings:
            value = settings[each.name]
            if isinstance(value, list):
                value = tuple(value)
            elif isinstance(value, str) and "Path" in str(each.type):
                value = Path(value)
            values[each.name] = value
    return Config(**values)


def options() -> dict[str, Option]:
    """What is known about each field, by name."""
    return {each.name: each.metadata["option"] for each in fields(Config)}


def having(quality: str) -> tuple[str, ...]:
    """Names of the options with a quality of ``Option``: "on_resume", "place", "evaluates" or "leads"."""
    return tuple(name for name, each in options().items() if getattr(each, quality))


def before_there_was_a_choice() -> dict[str, Any]:
    """Options that older runs lack, with their value in them."""
    return {each.name: each.metadata["before"] for each in fields(Config) if each.metadata["before"] is not ...}


def dashed(name: str) -> str:
    """As the command line spells it."""
    return name.replace("_", "-")


def plain(value: Any) -> Any:
    """As json has it."""
    return json.loads(json.dumps(value, default=str))


# Files count by their content, of which a checksum is recorded; a benchmark may be another one when a run is resumed.
MAY_CHANGE: Final = (*having("on_resume"), "benchmark_crc32")
EVALUATES: Final = (*having("evaluates"), "benchmark_crc32")  # all evaluations of a run share these
