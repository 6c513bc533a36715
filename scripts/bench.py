"""What the library costs: the learner's work a movement, how it grows, evaluations, what execute adds to physics, what
a replay costs, and two runs side by side.

The learner's overhead is all that a run does besides executing movements and evaluating: choosing the teacher's
demonstration, asking, telling, watching. It learns on a planar arm, whose own time does not count, with 25 joints for
the dimensions of the fishing rod, and with 50. Times are processor time. Other programs still lengthen it, as they
empty the caches; what runs briefly between physics feels that most. With --against the library in another folder does
the same work in turns (here, there, here, there ...), each time in a new process. Figures are medians over the rounds.

Examples:
  python scripts/bench.py                                       every part, some minutes
  python scripts/bench.py --against ../older --only overhead evaluation
  python scripts/bench.py --only growth --rows 5000 100000      how the work grows with what is remembered
"""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
import zlib
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from options import at_least

HERE = Path(__file__).resolve().parents[1]
ALGORITHMS = ("sgim-d", "sagg-riac")
JOINTS = (25, 50)
WINDOW = 200  # movements before and after a number of exemplars, over which the overhead there is measured
Figures = dict[str, float]


class Clock:
    """Processor time (s) spent in the calls of a function."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.seconds, self._function = 0.0, function

    def __call__(self, *arguments: Any) -> Any:
        begun = time.thread_time()
        found = self._function(*arguments)
        self.seconds += time.thread_time() - begun
        return found


class Life:
    """A learner on a planar arm, with a teacher for SGIM-D; its overhead can be measured at any time."""

    def __init__(self, algorithm: str, joints: int) -> None:
        from sgimd_torch import Demonstration, LocallyLinear, PeriodicTeacher, PlanarArm, sagg_riac, sgim_d, stream

        self.arm = arm = PlanarArm(joints, noise=0.02)
        self.movements, self.crc, self.teacher = 0, 0, None
        if algorithm == "sagg-riac":
            self.learner = sagg_riac(arm, 0, inverse=LocallyLinear)  # the default of earlier commits, for --against
        else:
            rng = stream(0, "bench")
            thetas = rng.random((100, joints))
            shown = [
                Demonstration(np.zeros(0), np.arange(2.0), np.stack((t, t)), arm.execute(np.zeros(0), t, rng))
                for t in thetas
            ]
            self.learner = sgim_d(
                arm, 0, correspondence=lambda times, trajectory: trajectory[-1], inverse=LocallyLinear
            )
            self.teacher = PeriodicTeacher(shown, stream(0, "teacher"))
        self._clock: Any = Clock(arm.execute)
        vars(arm)["execute"] = self._clock

    def overhead(self, n: int) -> float:
        """ms a movement over the next ``n`` movements."""
        from sgimd_torch import run

        begun = time.thread_time() - self._clock.seconds
        first, self.movements = self.movements, self.movements + n
        for episode in run(self.learner, self.arm, 0, first=first, movements=self.movements, teacher=self.teacher):
            self.crc = zlib.crc32(np.asarray(episode.outcome).tobytes(), self.crc)
        return 1000 * (time.thread_time() - self._clock.seconds - begun) / n

    def fill(self, n: int) -> tuple[float, float]:
        """Remember synthetic movements until there are ``n`` exemplars; the longest addition (s), and their 99.9th
        percentile.

        As in a life, ten in a row are variations of one movement, and neighbours are asked for now and then.
        """
        memory = self.learner.memory
        rng = np.random.default_rng(len(memory))
        missing = max(0, n - len(memory))
        centres = rng.random((missing // 10 + 1, self.arm.policies.dim)).repeat(10, axis=0)[:missing]
        thetas = self.arm.policies.clip(centres + 0.05 * rng.standard_normal(centres.shape))
        directions = np.cumsum(self.arm.angles(thetas), axis=1)
        outcomes = np.stack((np.cos(directions).mean(axis=1), np.sin(directions).mean(axis=1)), axis=1)
        seconds = np.zeros(missing)
        for row, (theta, outcome) in enumerate(zip(thetas, outcomes, strict=True)):
            begun = time.thread_time()
            memory.add(np.zeros(0), theta, outcome)
            if row % 16 == 0:  # what is remembered is asked for, too: trees and indices grow when they are needed
                memory.neighbourhoods(memory.near_outcomes(np.zeros(0), outcome, 1), 10)
            seconds[row] = time.thread_time() - begun
        return float(seconds.max(initial=0)), float(np.quantile(seconds, 0.999)) if missing else 0.0


def overhead(algorithm: str, joints: int, rows: list[int]) -> Figures:
    """At some numbers of movements from birth; and a checksum of all outcomes."""
    life, found = Life(algorithm, joints), {}
    for n in rows:
        life.overhead(n - WINDOW - life.movements)
        found[f"overhead, {algorithm}, {joints} joints, at {n} (ms)"] = life.overhead(2 * WINDOW)
    return {**found, f"checksum, {algorithm}, {joints} joints": life.crc}


def growth(algorithm: str, joints: int, rows: list[int]) -> Figures:
    """Overhead with synthetic exemplars, the longest additions, and what the memory takes over its raw arrays."""
    what, life, found = f"{algorithm}, {joints} joints", Life(algorithm, joints), {}
    life.overhead(WINDOW)
    base, first, longest, percentile = resident(), 0.0, 0.0, 0.0
    for n in rows:
        slowest, percentile = life.fill(n)
        longest = max(longest, slowest)
        life.overhead(WINDOW // 2)
        ms = life.overhead(5 * WINDOW)
        first = first or ms
        found[f"overhead, {what}, with {n} (ms)"] = ms
        if n != rows[0]:
            found[f"growth, {what}, {rows[0]} to {n}"] = ms / first
    memory = life.learner.memory
    raw = sum(array.nbytes for array in (memory.contexts, memory.thetas, memory.outcomes))
    found[f"memory over raw arrays, {joints} joints, {rows[-1]} rows"] = (resident() - base) / raw
    found[f"longest addition, {joints} joints (ms)"] = 1000 * longest
    found[f"99.9th percentile of additions, {joints} joints (ms)"] = 1000 * percentile
    return found


def recall(algorithm: str, joints: int, rows: list[int]) -> Figures:
    """Which part of the 10 nearest policies within any distance is found, after a life of so many movements."""
    life = Life(algorithm, joints)
    life.overhead(rows[-1])
    memory = life.learner.memory
    asked = np.random.default_rng(0).choice(len(memory), 300, replace=False)
    hits = 0
    for row, found in zip(asked, memory.neighbourhoods(asked, 10), strict=True):
        squared = np.square(memory.thetas - memory.thetas[row]).sum(axis=1)
        hits += len(set(squared.argsort(kind="stable")[:10]) & set(found))
    return {f"recall at 10, {algorithm}, {joints} joints, after {rows[-1]}": hits / (10 * len(asked))}


def evaluation() -> Figures:
    """Processor time of an evaluation with default options on the fishing rod, all threads together."""
    from sgimd_torch import Estimate, FishingRod, evaluate, load_benchmark, stream

    rod, goals = FishingRod(), load_benchmark().goals
    rng = stream(0, "bench")

    def inverse(context: Any, goal: Any) -> Any:
        theta = rod.policies.sample(rng)
        return Estimate(theta, theta[None], goal[None])

    rod.execute(rng.random(0), rod.policies.sample(rng), rng)  # imports what it needs, once in a process
    begun = time.process_time()
    found = evaluate(inverse, rod, goals, 0, 0)
    return {"evaluation (s)": time.process_time() - begun, "noise floor of it (m)": found.noise_floor}


def movement(n: int = 60) -> Figures:
    """``execute`` of the fishing rod against the same steps in C alone, in turns, the best of 15 readings each."""
    from mujoco import rollout

    from sgimd_torch import FishingRod, stream

    rod, calls = FishingRod(), list[tuple[Any, ...]]()
    step = rollout.Rollout.rollout

    def recording(self: Any, *arguments: Any, **options: Any) -> Any:
        calls.append((self, [np.copy(a) if isinstance(a, np.ndarray) else a for a in arguments], options))
        return step(self, *arguments, **options)

    ours, alone = 0.0, 0.0
    for i in range(n):
        theta = rod.policies.sample(stream(0, "bench", i))
        rollout.Rollout.rollout = recording
        rod.execute(np.zeros(0), theta, stream(1, "bench", i))
        rollout.Rollout.rollout = step
        readings = []
        for _ in range(15):
            rng = stream(1, "bench", i)
            begun = time.process_time()
            rod.execute(np.zeros(0), theta, rng)
            middle = time.process_time()
            for pool, arguments, options in calls:
                step(pool, *arguments, **options)
            readings.append((middle - begun, time.process_time() - middle))
        best = np.min(readings, axis=0)  # what disturbs a reading only makes it longer
        ours, alone = ours + best[0], alone + best[1]
        calls.clear()
    return {"execute (ms)": 1000 * ours / n, "execute over C stepping": ours / alone}


def resume(inverse: str, evaluate_at: str) -> Figures:
    """A run on the fishing rod, and its replay once it has ended: processor time of each, that of starting included."""
    words = f"-m sgimd_torch run --inverse {inverse} --evaluate-at {evaluate_at} --out runs".split()
    used = [0.0]
    with tempfile.TemporaryDirectory() as folder:
        for more in ([], ["--resume"]):
            subprocess.run([sys.executable, *words, *more], cwd=folder, capture_output=True, check=True)
            used.append(sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2]))
    fresh, replayed = np.diff(used)
    what = f"--inverse {inverse}, {'no' if evaluate_at == '[]' else 'all'} evaluations"
    return {f"run, {what} (s)": fresh, f"replay over run, {what}": replayed / fresh}


def fishing(movements: int) -> tuple[float, float]:
    """Seconds that SGIM-D on the fishing rod takes for so many movements, by the clock and of processor time."""
    from sgimd_torch import FishingRod, PeriodicTeacher, load_demonstrations, run, sgim_d, stream

    rod = FishingRod()
    learner = sgim_d(rod, 0, correspondence=rod.primitive.correspondence)
    teacher = PeriodicTeacher(load_demonstrations(), stream(0, "teacher"))
    clock, processor = time.perf_counter(), time.process_time()
    for _ in run(learner, rod, 0, movements=movements, teacher=teacher):
        pass
    return time.perf_counter() - clock, time.process_time() - processor


def pair(movements: int = 1000) -> Figures:
    """Movements a second of two runs side by side over those of one; 2 if they do not disturb each other."""
    with ProcessPoolExecutor(2) as pool:
        list(pool.map(fishing, (50, 50)))  # both processes have imported what they need
        alone = pool.submit(fishing, movements).result()
        both = list(pool.map(fishing, (movements, movements)))
    clock, processor = np.sum(np.array(alone) / both, axis=0).tolist()
    return {"two runs over one, by the clock": clock, "two runs over one, by processor time": processor}


PARTS: dict[str, Callable[..., Figures]] = {
    "overhead": overhead, "growth": growth, "recall": recall, "evaluation": evaluation, "movement": movement,
    "resume": resume, "pair": pair,
}  # fmt: skip


def resident() -> int:
    """Bytes of memory that this process holds now, without what its allocator keeps for later."""
    if sys.platform == "linux":
        ctypes.CDLL(None).malloc_trim(0)
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:  # not Linux: the most that it ever held
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def measured(library: Path, part: str, arguments: list[Any]) -> Figures:
    """What ``part`` finds in a new process that imports the library in the folder ``library``."""
    one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    command = [sys.executable, __file__, "--child", json.dumps([part, arguments])]
    done = subprocess.run(
        command, env={**os.environ, **one, "PYTHONPATH": str(library)}, stdout=subprocess.PIPE, text=True, check=True
    )
    found: Figures = json.loads(done.stdout.splitlines()[-1])
    return found


def main() -> int:
    """Measure, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--against", type=Path, help="folder of another copy of this repository, to compare with")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--rounds", type=at_least(1), default=3, help="measurements of each figure (3)")
    parser.add_argument("--rows", type=at_least(2 * WINDOW), nargs="+", default=[5000, 100_000, 1_000_000])
    parser.add_argument("--child", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        part, arguments = json.loads(options.child)
        print(json.dumps(PARTS[part](*arguments)))
        return 0
    if options.against is not None and not (options.against / "sgimd_torch").is_dir():
        parser.error(f"--against must be a folder with sgimd_torch in it, got {options.against}")
    if sorted(options.rows) != options.rows:
        parser.error(f"--rows must increase, got {options.rows}")
    libraries = [HERE] if options.against is None else [HERE, options.against.resolve()]
    work = [(part, arguments) for part in options.only for arguments in arguments_of(part, options.rows)]
    with tqdm(total=len(work) * options.rounds * len(libraries), leave=False, disable=None) as progress:
        for part, arguments in work:
            figures: list[list[Figures]] = [[] for _ in libraries]
            for _ in range(options.rounds):
                for library, several in zip(libraries, figures, strict=True):
                    several.append(measured(library, part, arguments))
                    progress.update()
            for name in figures[0][0]:
                show(name, [[one[name] for one in several] for several in figures])
    return 0


def arguments_of(part: str, rows: list[int]) -> list[list[Any]]:
    """What a part is measured with, one after the other."""
    if part == "overhead":
        return [[algorithm, joints, [1000, 5000]] for algorithm in ALGORITHMS for joints in JOINTS]
    if part == "growth":
        return [[*who, rows] for who in (("sagg-riac", 25), ("sagg-riac", 50), ("sgim-d", 7), ("sgim-d", 25))]
    if part == "recall":
        return [[*who, rows[:2]] for who in (("sgim-d", 25), ("sagg-riac", 50))]
    if part == "resume":
        return [[inverse, evaluate_at] for inverse in ("linear", "model") for evaluate_at in ("null", "[]")]
    return [[]]


def show(name: str, figures: list[list[float]]) -> None:
    """A line of the table."""
    medians = [float(np.median(several)) for several in figures]
    if name.startswith("checksum"):
        same = len({value for several in figures for value in several}) == 1
        print(f"{name:60}{'equal' if same else 'DIFFERENT'}", flush=True)
        return
    ratio = f"{medians[0] / medians[1]:10.2f}" if len(medians) == 2 and medians[1] else ""
    print(f"{name:60}" + "".join(f"{median:12.4g}" for median in medians) + ratio, flush=True)


if __name__ == "__main__":
    sys.exit(main())
