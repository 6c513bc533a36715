"""Measure what the library costs: this checkout alone (here), or also another commit (there).

Each figure is measured in turns (here, there, here, there ...), each time in a new process. The table has the medians
and their ratio. Times are processor times unless a clock is named; other programs lengthen them, too.

  learning  a learner's time for a movement, without the robot's, after 250 to 20,000 movements of a life: the mean of
            the fastest 90 of the next 100; its ratio to the rod's physics in the same process; and the ratio in the
            mean of the whole life so far, fits of the local process included
  memory    a query for ten neighbours over faiss's plain flat search, and its recall; for more rows type --movements
  at-once   movements a second by the clock, with several robots at once (here alone)
  run       `sgimd run` of practice on the fishing rod, and the times of its parts by the clock

Examples:
  python scripts/bench.py                                         this checkout alone; takes half an hour
  python scripts/bench.py --against f7c5dbb --only learning run   this checkout and the commit f7c5dbb
"""

from __future__ import annotations

import argparse
import json
import os
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import closing, nullcontext
from functools import partial
from itertools import islice, product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from jsonargparse.typing import PositiveInt
from tqdm import tqdm

from sgimd_torch.environments.planar_arm import PlanarArm

HERE = Path(__file__).resolve().parents[1]
LIVES = [
    f"{algorithm}-{robot}" for algorithm, robot in product(("practice", "sgim-d", "sagg-riac"), ("rod", "7", "50"))
]
SIZES = 250, 1000, 5000, 20_000  # numbers of exemplars
LOADED = 50  # number of movements after which everything is loaded
Figures = dict[str, float]
Measurement = Callable[[Path, int], Figures]


class SlowArm(PlanarArm):
    """An arm whose movement takes 20 ms; it moves one by one."""

    execute_many = None  # type: ignore[assignment]

    def execute(self, context: Any, theta: Any, rng: np.random.Generator) -> Any:
        """The outcome, after 20 ms."""
        time.sleep(0.02)
        return super().execute(context, theta, rng)


def seconds(work: Callable[[], Any], clock: Callable[[], float] = time.process_time) -> float:
    """Time of a piece of work."""
    begun = clock()
    work()
    return clock() - begun


def live(name: str, movements: int) -> Figures:
    """Times of a learner's life with the library that this process imports.

    Args:
        name: algorithm and robot, one of ``LIVES``; a number is the number of joints of a planar arm.
        movements: number of movements that are measured at each of ``SIZES``.
    """
    import sgimd_torch
    from sgimd_torch import Demonstration, FishingRod, PeriodicTeacher, run, stream

    algorithm, _, joints = name.rpartition("-")
    rod = FishingRod(threads=1)
    robot: Any = rod if joints == "rod" else PlanarArm(int(joints), noise=0.02)
    execute, empty, rng, of_robot = robot.execute, np.zeros(0), stream(0, "bench"), 0.0

    def demonstration() -> Demonstration:
        theta = robot.policies.sample(rng)
        return Demonstration(empty, np.arange(2.0), np.stack((theta, theta)), execute(empty, theta, rng))

    def timed(*arguments: Any) -> Any:
        nonlocal of_robot
        begun = time.process_time()
        outcome = execute(*arguments)
        of_robot += time.process_time() - begun
        return outcome

    def cast() -> None:
        for theta in stream(1, "bench").random((20, 25)):
            FishingRod.execute(rod, empty, theta, rng)

    taught = algorithm == "sgim-d"
    more: dict[str, Any] = {"correspondence": lambda times, path: path[-1]} if taught else {}
    learner = getattr(sgimd_torch, algorithm.replace("-", "_"))(robot, 0, **more)
    teacher = PeriodicTeacher([demonstration() for _ in range(100)], stream(0, "teacher")) if taught else None
    robot.execute = timed
    life, times = run(learner, robot, 0, movements=10**9, teacher=teacher), list[float]()
    figures: Figures = {}
    for n in SIZES:
        while len(times) < n + movements:
            if len(times) == n:
                physics = seconds(cast)
            of_robot = 0.0
            spent = seconds(partial(next, life))
            times.append(spent - of_robot)
        physics = min(physics, seconds(cast)) / 20
        learning = float(np.sort(times[n:])[: 1 + 9 * movements // 10].mean())
        where = f"{name}, {n} exemplars"
        figures[f"{where} (ms)"] = 1000 * learning
        figures[f"{where}, over the rod's physics"] = learning / physics
        figures[f"{where}, whole life so far"] = float(np.mean(times[LOADED:])) / physics
    return figures


def memory(most: int) -> Figures:
    """Time of a query over that of faiss's flat search, and recall of ten neighbours among ``most`` rows."""
    import faiss

    from sgimd_torch.memory.growing import Growing
    from sgimd_torch.memory.neighbours import Flat, Graph
    from sgimd_torch.spaces import stream

    figures: Figures = {}
    for dim, kind in product((2, 25, 50), ("uniform", "clustered")):
        rng = stream(dim, kind)
        centres = rng.random((most // 1000 + 10, dim)) if kind == "clustered" else np.zeros((1, dim))
        spread = rng.normal(0, 0.02, (most, dim)) if kind == "clustered" else rng.random((most, dim))
        rows = centres[rng.integers(len(centres), size=most)] + spread
        for n in sorted({500, 5000, most}):
            side, exact, index = Graph(Growing(dim, rows[:n])), Flat(Growing(dim, rows[:n])), faiss.IndexFlatL2(dim)
            index.add(rows[:n].astype(np.float32))
            queries = rows[rng.integers(n, size=100)] + rng.normal(0, 0.01, (100, dim))
            singles = queries.astype(np.float32)
            side.nearest(queries[:1], 10)  # the index is built
            ours = seconds(partial(list, map(partial(side.nearest, k=10), queries[:, None])))
            plain = seconds(partial(list, map(partial(index.search, k=10), singles[:, None])))
            where = f"{n} {kind} rows of {dim}"
            figures[f"{where} (ms)"], figures[f"{where}, over plain"] = 10 * ours, ours / plain
            if n == most:
                pairs = zip(side.nearest(queries, 10), exact.nearest(queries, 10), strict=True)
                figures[f"{where}, recall"] = float(np.mean([np.isin(one, other).mean() for one, other in pairs]))
    return figures


def at_once(movements: int) -> Figures:
    """Movements a second by the clock, with several robots at once."""
    from sgimd_torch import FishingRod, practice, run
    from sgimd_torch.environments.protocol import moves_in_batches
    from sgimd_torch.extras.at_once.processes import in_processes
    from sgimd_torch.session import JOINS_EVERY, live

    figures: Figures = {}
    robots = ("rod", FishingRod, (1, 2, 8)), ("an arm of 20 ms", partial(SlowArm, 7, noise=0.02), (1, 2))
    for name, make, numbers in robots:
        for number in numbers:
            robot: Any = make()
            alone = number == 1 or moves_in_batches(robot)
            with nullcontext(live(robot, 0)) if alone else in_processes(make, 0, number) as execute:
                life = run(practice(robot, 0), robot, 0, movements=10**9, execute=execute, at_once=number)
                for _ in range(JOINS_EVERY * number):  # all robots join, processes start
                    next(life)
                spent = seconds(partial(list, islice(life, movements)), time.perf_counter)
            figures[f"practice on {name}, {number} at once (movements/s)"] = movements / spent
    return figures


def in_child(name: str, library: Path, movements: int) -> Figures:
    """Figures of a new process that imports ``library``."""
    command = [sys.executable, __file__, "--child", name, "--movements", str(movements)]
    done = subprocess.run(command, env=environment(library), stdout=subprocess.PIPE, text=True, check=True)
    return dict(json.loads(done.stdout))


def whole_run(library: Path, movements: int) -> Figures:
    """Processor time of a run of practice on the rod as a user types it, all included, and the seconds of its parts."""
    command = [sys.executable, "-m", "sgimd_torch", "run", "--algorithm=practice", f"--movements={movements}"]
    with TemporaryDirectory() as folder:
        process = subprocess.Popen(command, cwd=folder, env=environment(library, {}), stdout=subprocess.DEVNULL)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            raise RuntimeError(f"{' '.join(command)} failed, see above")
        (file,) = Path(folder).rglob("run.sqlite")
        with closing(sqlite3.connect(file)) as record:  # `read_run` may not know the layout of the other commit
            ((parts,),) = record.execute("SELECT value FROM about WHERE name = 'seconds'")
    shares = {
        f"its {name.removeprefix('seconds_')} (s by the clock)": spent for name, spent in json.loads(parts).items()
    }
    return {"run on the rod (s)": used.ru_utime + used.ru_stime, **shares}


ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def environment(library: Path, more: dict[str, str] = ONE_THREAD) -> dict[str, str]:
    """Variables of a process that imports ``library``."""
    return {**os.environ, **more, "PYTHONPATH": str(library)}


def show(name: str, several: list[list[float]]) -> None:
    """Print the medians of each commit, and the ratio of the medians here to those there."""
    medians = [float(np.median(values)) for values in several]
    cells = [f"{median:.4g}" for median in medians] + [f"{medians[0] / medians[-1]:.3f}"] * (len(medians) - 1)
    print(f"{name:56}" + "".join(f"{cell:>12}" for cell in cells), flush=True)


PARTS: dict[str, tuple[list[Measurement], int]] = {  # measurements by name of the part, and their number of movements
    "learning": ([partial(in_child, name) for name in LIVES], 100),
    "memory": ([partial(in_child, "memory")], 100_000),
    "at-once": ([partial(in_child, "at-once")], 400),
    "run": ([whole_run], 2000),
}


def main() -> int:
    """Measure, print a table, and return the exit code 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--against", metavar="COMMIT", help="commit of this repository to compare with")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--rounds", type=PositiveInt, default=3, help="repetitions of each figure (default: 3)")
    parser.add_argument("--movements", type=PositiveInt, help="number of movements of each run (default: by part)")
    parser.add_argument("--child", choices=[*LIVES, "memory", "at-once"], help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        measured = {"at-once": at_once, "memory": memory}.get(options.child, partial(live, options.child))
        print(json.dumps(measured(options.movements)))
        return 0
    with TemporaryDirectory() as folder:
        libraries = [HERE]
        if options.against:
            libraries.append(Path(folder))
            archive = ["git", "-C", str(HERE), "archive", options.against, "sgimd_torch"]
            packed = subprocess.run(archive, stdout=subprocess.PIPE)
            if packed.returncode:
                parser.error(f"--against must be a commit with sgimd_torch in it, got {options.against}")
            subprocess.run(["tar", "-x", "-C", folder], input=packed.stdout, check=True)
        for library in libraries:  # older commits have nothing to compile
            compiling = "from sgimd_torch.memory.compiled import compile_all; compile_all()"
            subprocess.run([sys.executable, "-c", compiling], env=environment(library), stderr=subprocess.DEVNULL)
        print(f"{'':56}" + "".join(f"{name:>12}" for name in ("here", "there", "here/there")[: 2 * len(libraries) - 1]))
        work = [(part, measure) for part in options.only for measure in PARTS[part][0]]
        for part, measure in tqdm(work, leave=False, disable=None):
            movements, compared = (
                options.movements or PARTS[part][1],
                libraries[: 1 if part in ("at-once", "memory") else 2],
            )
            rounds = [[measure(library, movements) for library in compared] for _ in range(options.rounds)]
            for name in rounds[0][0]:
                show(name, [[figures[name] for figures in several] for several in zip(*rounds, strict=True)])
    return 0


if __name__ == "__main__":
    sys.exit(main())
