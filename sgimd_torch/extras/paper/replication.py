"""The numbers of the page of ``sgimd paper``, beside the paper's statements.

Section 6 of Nguyen & Oudeyer (2014).   study = Replication(config, variants); study.anova().rows
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from scipy import stats

from sgimd_torch.demonstrations import SHIPPED, load_demonstrations
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.environments.protocol import execute_many
from sgimd_torch.extras.table.names import NAMES
from sgimd_torch.extras.table.results import MISSING
from sgimd_torch.extras.table.statistics import Interval, interval_text
from sgimd_torch.extras.table.variants import Variant
from sgimd_torch.options.config import Config
from sgimd_torch.runs.plan import task_of
from sgimd_torch.spaces import Array, Box, Demonstration, stream
from sgimd_torch.tasks.taught import theta_of

LEARNERS: Final = ("random", "sagg-riac", "observation", "imitation", "sgim-d")
TAUGHT: Final = ("observation", "imitation", "sgim-d")
BY: Final = {1: "-demonstrator-1", 2: "-demonstrator-2", 3: ""}  # endings of variants by their demonstrator
SMALL: Final = Box.cube(-1.0, 1.0, 2)  # T of the paper (m), of which the large T is 10^4 times
TILE: Final = 0.1  # m, side of the tiles by which the reached part of T is counted
POLICIES: Final = 20  # number of random policies that are repeated
REPEATS: Final = 20  # number of repetitions of each
LEVEL: Final = 0.05  # significance level of an analysis of variance over all parameters together


class Table(NamedTuple):
    """A table of the page: its caption, its head, and rows of texts."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]


class Mapped(NamedTuple):
    """A joint of a recording, and how the robot repeats it, eq. (6).

    Attributes:
        joint: number of the joint, from 1.
        misfit: root mean square of repeated minus recorded angles (rad).
        times: ``(n,)`` s.
        recorded, repeated: ``(n,)`` angles (rad).
        knots: ``(4,)`` angles (rad) of theta_d, evenly spread over the movement.
    """

    joint: int
    misfit: float
    times: Array
    recorded: Array
    repeated: Array
    knots: Array


class Replication:
    """The runs of the study.

    Args:
        config: settings of SGIM-D's runs, from which the rod comes.
        variants: variants by name; the names are learners with the endings of ``BY``, or with "-large".
    """

    def __init__(self, config: Config, variants: Mapping[str, Variant]) -> None:
        self._task, self.variants = task_of(config), variants

    @cached_property
    def demonstrators(self) -> dict[int, list[Demonstration]]:
        """The recordings of each demonstrator, by number."""
        return {k: load_demonstrations(SHIPPED.with_name(f"demonstrator_{k}.npz")) for k in BY}

    @cached_property
    def demonstrated(self) -> dict[int, Array]:
        """Policies theta_d ``(n, theta_dim)`` of the recordings of each demonstrator."""
        return {
            k: np.stack([theta_of(self._task, demonstration) for demonstration in shown])
            for k, shown in self.demonstrators.items()
        }

    def mapped(self) -> list[Mapped]:
        """The joints with the largest and the smallest misfit, of the recording of demonstrator 3 with the largest."""
        rod, best, found = self._task.environment, 0.0, list[Mapped]()
        assert isinstance(rod, FishingRod)
        for shown, theta in zip(self.demonstrators[3], self.demonstrated[3], strict=True):
            times = shown.times - shown.times[0]
            repeated = rod.primitive.at(theta, times)
            misfits = np.sqrt(np.mean((repeated - shown.trajectory) ** 2, axis=0))
            if misfits.max() > best:
                best, joints = misfits.max(), rod.primitive.joints
                knots = joints.low[:, None] + theta[:-1].reshape(joints.dim, -1) * joints.sides[:, None]
                found = [
                    Mapped(j + 1, misfits[j], times, shown.trajectory[:, j], repeated[:, j], knots[j])
                    for j in (misfits.argmax(), misfits.argmin())
                ]
        return found

    @cached_property
    def taught(self) -> dict[int, Array]:
        """Policies ``(n, theta_dim)`` of all movements of SGIM-D's runs, by demonstrator."""
        thetas = {
            k: np.concatenate([run.thetas for run in self.variants[f"sgim-d{end}"].runs]) for k, end in BY.items()
        }
        return {k: every[np.isfinite(every).all(axis=1)] for k, every in thetas.items()}

    @cached_property
    def repeated(self) -> Array:
        """``(POLICIES, REPEATS, 2)`` m, outcomes of random policies, each repeated."""
        rod = self._task.environment
        thetas = np.repeat([rod.policies.sample(stream(0, "policy", k)) for k in range(POLICIES)], REPEATS, axis=0)
        rngs = [stream(0, "repetition", k) for k in range(len(thetas))]
        outcomes = execute_many(rod, np.zeros((len(thetas), rod.contexts.dim)), thetas, rngs)
        return np.reshape(np.asarray(outcomes, dtype=np.float64), (POLICIES, REPEATS, 2))

    def ratios(self) -> Table:
        """Errors at the end, relative to each other."""
        pairs = {
            ("sgim-d", "random"): "½",
            ("sagg-riac", "random"): "below 1",
            ("imitation", "random"): "below 1",
            ("imitation", "sagg-riac"): "about 1",
            ("observation", "random"): "above 1",
        }
        rows = [
            (f"{NAMES[ours]} / {NAMES[theirs]}", says, _ratio(self.variants[ours], self.variants[theirs]))
            for (ours, theirs), says in pairs.items()
        ]
        floor = self.variants["sgim-d"].at(self.variants["sgim-d"].compared_at, "noise_floor")
        rows.append(("SGIM-D / its noise floor", "near 1", _over(self.variants["sgim-d"].last_error, floor)))
        spread = {name: self.variants[name].errors[:, -1].std() for name in ("imitation", "sagg-riac")}
        few = spread["sagg-riac"] == 0
        quotient = MISSING if few else f"{spread['imitation'] / spread['sagg-riac']:.2f}"
        rows.append(("standard deviation over seeds: Imitation / SAGG-RIAC", "far below 1", quotient))
        return Table("Errors after the last movement, divided by each other", ("", "paper", "here"), rows)

    def by_demonstrator(self) -> Table:
        """Errors at the end, by learner and demonstrator."""
        rows = [(NAMES[name], *(_error(self.variants[name + end]) for end in BY.values())) for name in TAUGHT]
        rows.append((f"{NAMES['sagg-riac']}, not taught", *[_error(self.variants["sagg-riac"])] * len(BY)))
        return Table("Errors after the last movement (m)", ("learner", *(f"demonstrator {k}" for k in BY)), rows)

    def explored(self) -> Table:
        """The part of T that outcomes reach."""
        rows = []
        for name in ("random", "sagg-riac", "sgim-d"):
            outcomes = [run.outcomes[np.isfinite(run.outcomes).all(axis=1)] for run in self.variants[name].runs]
            tiles = np.mean([len(np.unique(np.floor(landed / TILE), axis=0)) for landed in outcomes])
            nearest, farthest = np.quantile(np.linalg.norm(np.concatenate(outcomes), axis=1), (0.01, 0.99))
            rows.append((NAMES[name], f"{tiles:.0f}", f"{nearest:.2f}", f"{farthest:.2f}"))
        head = (
            "learner",
            f"tiles of {TILE:g} m reached",
            "1 % land nearer to the base than (m)",
            "1 % land farther away than (m)",
        )
        return Table("Outcomes, the mean over seeds", head, rows)

    def monotonic(self) -> Table:
        """How regularly each demonstrator moves the joints."""
        rows = []
        for k, shown in self.demonstrators.items():
            steps = [np.diff(demonstration.trajectory, axis=0) for demonstration in shown]
            straight = np.array([(step >= 0).all(axis=0) | (step <= 0).all(axis=0) for step in steps])
            rows.append(
                (f"demonstrator {k}", str(len(shown)), f"{straight[:, 0].mean():.0%}", f"{straight.mean():.0%}")
            )
        return Table(
            "Recordings in which a joint moves in one direction only", ("", "recordings", "joint 1", "all joints"), rows
        )

    def anova(self) -> Table:
        """Analyses of variance of each parameter of theta, and of its spread, which is its distance from the median."""
        rng = stream(0, "random policies")
        policies, groups = self._task.environment.policies, dict[str, tuple[Array, ...]]()
        for k, shown in self.demonstrated.items():
            at_random = np.stack([policies.sample(rng) for _ in shown])
            groups[f"demonstrator {k} and as many random movements"] = shown, at_random
        groups["movements of SGIM-D with each demonstrator"] = tuple(self.taught.values())
        rows = []
        for name, samples in groups.items():
            ratios, p = stats.f_oneway(*samples, axis=0)
            _, of_spread = stats.f_oneway(*(np.abs(thetas - np.median(thetas, axis=0)) for thetas in samples), axis=0)
            means, spreads = (f"{(values < LEVEL / len(p)).sum()} of {len(p)}" for values in (p, of_spread))
            rows.append((name, means, f"{ratios.max():.0f}", f"{p.min():.0e}" if p.min() else "below 1e-300", spreads))
        return Table(
            f"One-way analysis of variance of each parameter of θ; p < {LEVEL:g} / number of parameters counts",
            ("", "parameters that differ in mean", "largest F", "smallest p", "in spread (Brown-Forsythe)"),
            rows,
        )

    def large(self) -> Table:
        """Errors in both task spaces; Random chooses no goals, so it is alike in both."""
        rows = [(NAMES["random"], _error(self.variants["random"]), _error(self.variants["random"]), "1")]
        for name in ("sagg-riac", "sgim-d"):
            small, large = self.variants[name], self.variants[f"{name}-large"]
            rows.append((NAMES[name], _error(small), _error(large), _ratio(large, small)))
        return Table("Errors after the last movement (m)", ("learner", "T", "T 10⁴ times larger", "ratio"), rows)

    def goals(self) -> Table:
        """How many goals of learners in the large T are in the paper's T."""
        rows = []
        for name in ("sagg-riac", "sgim-d"):
            chosen = self.chosen(name)
            inside = int(SMALL.contains(chosen).sum())
            rows.append((NAMES[name], str(len(chosen)), str(inside), f"{inside / max(len(chosen), 1):.2%}"))
        return Table(
            "Goals chosen in the large T, by all seeds; by chance 0.01 % lie in [-1, 1]²",
            ("learner", "goals", "in [-1, 1]²", "share"),
            rows,
        )

    def chosen(self, name: str) -> Array:
        """``(n, 2)`` m, goals that a learner chose in the large T, of all seeds."""
        return np.concatenate([run.chosen_goals() for run in self.variants[f"{name}-large"].runs])

    def scatter(self) -> Table:
        """Standard deviations of repeated movements."""
        says = ("0.005, 0.033", "0.072, 0.041", "0.016, 0.016")
        rows = [
            (f"policy {k}", told, "{:.3f}, {:.3f}".format(*outcomes.std(axis=0, ddof=1)))
            for k, (told, outcomes) in enumerate(zip(says, self.repeated, strict=False), 1)
        ]
        rows.append((f"mean of {POLICIES} random policies", "0.073", f"{self.repeated.std(axis=1, ddof=1).mean():.3f}"))
        return Table(
            f"Standard deviations of {REPEATS} repetitions in x and y (m); the paper repeated other policies",
            ("", "paper", "here"),
            rows,
        )


def _error(variant: Variant) -> str:
    return MISSING if variant.last_error is None else interval_text(variant.last_error, ".3f")


def _ratio(ours: Variant, theirs: Variant) -> str:
    return _over(ours.last_error, theirs.last_error)


def _over(ours: Interval | None, theirs: Interval | None) -> str:
    return f"{ours.value / theirs.value:.2f}" if ours and theirs else MISSING
