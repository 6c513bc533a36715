"""Measure time and memory of the library: of this checkout alone (here), or also of another commit (there).

Each figure is measured in turns (here, there, here, there ...), each time in a new process. The table has the medians
and their ratio. Times are processor times; other programs still lengthen them, because they empty the caches.

  learning  a learner's time for a movement, without the robot's time; the learner's time divided by the robot's; a
            checksum of all outcomes, which is equal if both commits learn equally
  resume    time of a run on the fishing rod, and of the replay of this run
  life      a long run on a planar arm of 7 joints: time, largest memory of the process, size of the run's folder

Examples:
  python scripts/bench.py                                          this checkout alone; takes some minutes
  python scripts/bench.py --against main --only learning resume    this checkout and the commit main
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
import zlib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from jsonargparse.typing import PositiveInt
from tqdm import tqdm

HERE = Path(__file__).resolve().parents[1]
LIVES = ("random-25", "sagg-riac-25", "sgim-d-25", "practice-25", "practice-50", "practice-rod")
Figures = dict[str, float]
Measurement = Callable[[Path, int], Figures]


def live(name: str, movements: int) -> Figures:
    """Figures of a learner with the library that this process imports.

    Args:
        name: algorithm and robot, one of ``LIVES``; a number is the number of joints of a planar arm.
        movements: number of movements of the learner.
    """
    import sgimd_torch
    from sgimd_torch import Demonstration, FishingRod, PeriodicTeacher, PlanarArm, run, stream

    algorithm, _, joints = name.rpartition("-")
    robot: Any = FishingRod() if joints == "rod" else PlanarArm(int(joints), noise=0.02)
    make = getattr(sgimd_torch, {"random": "random_exploration"}.get(algorithm, algorithm.replace("-", "_")))
    teacher, taught = None, dict[str, Any]()
    if algorithm == "sgim-d":
        context, rng = np.zeros(0), stream(0, "bench")
        shown = [
            Demonstration(context, np.arange(2.0), np.stack((theta, theta)), robot.execute(context, theta, rng))
            for theta in rng.random((100, int(joints)))
        ]
        teacher, taught = PeriodicTeacher(shown, stream(0, "teacher")), {"correspondence": lambda times, path: path[-1]}
    learner, execute, of_robot = make(robot, 0, **taught), robot.execute, 0.0

    def timed(*arguments: Any) -> Any:
        nonlocal of_robot
        begun = time.process_time()
        outcome = execute(*arguments)
        of_robot += time.process_time() - begun
        return outcome

    robot.execute = timed
    checksum, begun = 0, time.process_time()
    for episode in run(learner, robot, 0, movements=movements, teacher=teacher):
        checksum = zlib.crc32(np.asarray(episode.outcome).tobytes(), checksum)
    learning = time.process_time() - begun - of_robot
    return {
        f"{name} (ms a movement)": 1000 * learning / movements,
        f"{name}, learning over robot": learning / of_robot,
        f"{name}, checksum": checksum,
    }


def measured(name: str, library: Path, movements: int) -> Figures:
    """Figures of a learner in a new process that imports ``library``."""
    command = [sys.executable, __file__, "--child", name, "--movements", str(movements)]
    done = subprocess.run(command, env=environment(library), stdout=subprocess.PIPE, text=True, check=True)
    return dict(json.loads(done.stdout))


def resume(library: Path, movements: int) -> Figures:
    """Times of a taught run, and of its replay; both times include the start of the process."""
    with TemporaryDirectory() as folder:
        words = "--algorithm=practice-taught", f"--movements={movements}"
        fresh, _ = command_line(library, folder, *words)
        replay, _ = command_line(library, folder, *words, "--resume")
    return {"run on the rod (s)": fresh, "its replay (s)": replay, "replay over run": replay / fresh}


def long_life(library: Path, movements: int) -> Figures:
    """Figures of a run on an arm of 7 joints, whose physics takes hardly any time."""
    with TemporaryDirectory() as folder:
        words = ("--environment=planar-arm-7", f"--movements={movements}", f"--evaluate-at=[{movements}]")
        seconds, memory = command_line(library, folder, *words)
        size = sum(path.stat().st_size for path in Path(folder).rglob("*") if path.is_file()) / 1e6
    return {"life on an arm (s)": seconds, "its largest memory (MiB)": memory, "its folder (MB)": size}


def command_line(library: Path, folder: str, *words: str) -> tuple[float, float]:
    """Processor time (s) and largest memory (MiB) of ``sgimd run`` in a folder."""
    command = [sys.executable, "-m", "sgimd_torch", "run", "--out=runs", *words]
    process = subprocess.Popen(command, cwd=folder, env=environment(library), stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"{' '.join(command)} failed, see above")
    kilobytes = used.ru_maxrss / (1024 if sys.platform == "darwin" else 1)
    return used.ru_utime + used.ru_stime, kilobytes / 1024


def environment(library: Path) -> dict[str, str]:
    """Variables of a process that imports ``library`` and computes with one thread."""
    one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    return {**os.environ, **one, "PYTHONPATH": str(library)}


def show(name: str, several: list[list[float]]) -> None:
    """Print the medians of each commit, and the ratio of the medians here to those there."""
    if name.endswith("checksum"):
        cells = ["equal" if len({value for values in several for value in values}) == 1 else "DIFFERENT"]
    else:
        medians = [float(np.median(values)) for values in several]
        cells = [f"{median:.4g}" for median in medians] + [f"{medians[0] / medians[-1]:.3f}"] * (len(medians) - 1)
    print(f"{name:45}" + "".join(f"{cell:>12}" for cell in cells), flush=True)


PARTS: dict[str, tuple[list[Measurement], int]] = {  # measurements by name of the part, and their number of movements
    "learning": ([partial(measured, name) for name in LIVES], 2000),
    "resume": ([resume], 5000),
    "life": ([long_life], 100_000),
}


def main() -> int:
    """Measure, print a table, and return the exit code 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--against", metavar="COMMIT", help="commit of this repository to compare with")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--rounds", type=PositiveInt, default=3, help="repetitions of each figure (default: 3)")
    parser.add_argument("--movements", type=PositiveInt, help="number of movements of each run (default: by part)")
    parser.add_argument("--child", choices=LIVES, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        print(json.dumps(live(options.child, options.movements)))
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
        print(f"{'':45}" + "".join(f"{name:>12}" for name in ("here", "there", "here/there")[: 2 * len(libraries) - 1]))
        work = [(measure, options.movements or PARTS[part][1]) for part in options.only for measure in PARTS[part][0]]
        for measure, movements in tqdm(work, leave=False, disable=None):
            figures = [[measure(library, movements) for library in libraries] for _ in range(options.rounds)]
            for name in figures[0][0]:
                show(name, [[found[name] for found in several] for several in zip(*figures, strict=True)])
    return 0


if __name__ == "__main__":
    sys.exit(main())
