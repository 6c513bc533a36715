"""What the library costs, as ratios measured side by side: this checkout against another one.

Each part is done in turns (here, there, here, there ...), each time in a new process; a ratio is that of the medians.
Times are processor time; other programs still lengthen it, as they empty the caches.

  movement  ms a movement that a learner takes on a planar arm of 25 joints, without the arm's own time, and a checksum
            of all outcomes, which says whether both learnt the same
  practice  what learning costs `practice`: over the rod's physics in a life of 2000 movements, and ms a movement on a
            planar arm of 50 joints, in the first fifth of the life and after it
  resume    a run on the fishing rod, and its replay once it has ended
  life      a long run on a planar arm of 7 joints: time, the largest memory of the process, and the size of its folder

Examples:
  python scripts/bench.py                                          this checkout alone, some minutes
  python scripts/bench.py --against ../older --only movement resume
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
import zlib
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from jsonargparse.typing import PositiveInt
from tqdm import tqdm

HERE = Path(__file__).resolve().parents[1]
LEARNERS = ("random", "sagg-riac", "sgim-d", "practice")
JOINTS = 25
ROBOTS = ("rod", "arm")
Figures = dict[str, float]


class Clock:
    """Processor time (s) spent in the calls of a function."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.seconds, self._function = 0.0, function

    def __call__(self, *arguments: Any) -> Any:
        begun = time.process_time()
        found = self._function(*arguments)
        self.seconds += time.process_time() - begun
        return found


def life_of(name: str, movements: int) -> Figures:
    """ms a movement over a learner's life on an arm, besides the arm's own, and a checksum of its outcomes."""
    from sgimd_torch import Demonstration, PeriodicTeacher, PlanarArm, algorithms, run, stream

    arm, rng = PlanarArm(JOINTS, noise=0.02), stream(0, "bench")
    make = getattr(algorithms, {"random": "random_exploration"}.get(name, name.replace("-", "_")))
    teacher, taught = None, dict[str, Any]()
    if name == "sgim-d":
        shown = [
            Demonstration(np.zeros(0), np.arange(2.0), np.stack((theta, theta)), arm.execute(np.zeros(0), theta, rng))
            for theta in rng.random((100, JOINTS))
        ]
        teacher, taught = PeriodicTeacher(shown, stream(0, "teacher")), {"correspondence": lambda times, path: path[-1]}
    learner = make(arm, 0, **taught)
    vars(arm)["execute"] = clock = Clock(arm.execute)
    checksum, begun = 0, time.process_time()
    for episode in run(learner, arm, 0, movements=movements, teacher=teacher):
        checksum = zlib.crc32(np.asarray(episode.outcome).tobytes(), checksum)
    seconds = time.process_time() - begun - clock.seconds
    return {f"{name} (ms a movement)": 1000 * seconds / movements, f"{name}, checksum": checksum}


def practised(robot: str, movements: int) -> Figures:
    """What learning costs `practice` on the rod, over the physics; on an arm of 50 joints, ms a movement."""
    from sgimd_torch import FishingRod, PlanarArm, practice, run

    environment = FishingRod() if robot == "rod" else PlanarArm(50)
    learner = practice(environment, 0)
    vars(environment)["execute"] = clock = Clock(environment.execute)
    found, last, before, begun = Figures(), 0, 0.0, time.process_time()
    for episode in run(learner, environment, 0, movements=movements):
        made, seconds = episode.index + 1, time.process_time() - begun - clock.seconds
        if made == movements and robot == "rod":
            found["practice on the rod, learning over physics"] = seconds / clock.seconds
        if made in (movements // 5, movements) and robot == "arm":
            found[f"practice on 50 joints, to {made} (ms)"] = 1000 * (seconds - before) / (made - last)
            last, before = made, seconds
    return found


def measured(library: Path, name: str, movements: int) -> Figures:
    """The same, in a new process that imports the library of another checkout."""
    command = [sys.executable, __file__, "--child", name, "--movements", str(movements)]
    done = subprocess.run(command, env=_environment(library), stdout=subprocess.PIPE, text=True, check=True)
    found: Figures = json.loads(done.stdout.splitlines()[-1])
    return found


def resume(library: Path, movements: int) -> Figures:
    """A run with default options, and its replay after its end: processor time of each, that of starting included."""
    with TemporaryDirectory() as folder:
        fresh, _ = _run(library, folder, f"--movements={movements}")
        replay, _ = _run(library, folder, f"--movements={movements}", "--resume")
    return {"run on the rod (s)": fresh, "its replay (s)": replay, "replay over run": replay / fresh}


def long_life(library: Path, movements: int) -> Figures:
    """A run on an arm of 7 joints, whose physics hardly counts."""
    with TemporaryDirectory() as folder:
        words = ("--environment=planar-arm-7", f"--movements={movements}", f"--evaluate-at=[{movements}]")
        seconds, memory = _run(library, folder, *words)
        size = sum(path.stat().st_size for path in Path(folder).rglob("*") if path.is_file())
    return {
        f"{movements} movements on an arm (s)": seconds,
        "its largest memory (MiB)": memory,
        "its folder (MB)": size / 1e6,
    }


def _run(library: Path, folder: str, *words: str) -> tuple[float, float]:
    """Processor time (s) and the largest memory (MiB) of a run by the command line of a checkout."""
    command = [sys.executable, "-m", "sgimd_torch", "run", "--out=runs", *words]
    with open(Path(folder) / "said.txt", "wb") as said:
        process = subprocess.Popen(command, cwd=folder, env=_environment(library), stdout=said, stderr=said)
        _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"{' '.join(command)} failed in {library}: {(Path(folder) / 'said.txt').read_text()}")
    kilobytes = used.ru_maxrss / (1024 if sys.platform == "darwin" else 1)
    return used.ru_utime + used.ru_stime, kilobytes / 1024


def _environment(library: Path) -> dict[str, str]:
    one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    return {**os.environ, **one, "PYTHONPATH": str(library)}


def show(name: str, several: Sequence[Sequence[float]]) -> None:
    """A line of the table: the medians of each checkout, and the ratio of ours to theirs."""
    if name.endswith("checksum"):
        same = len({value for found in several for value in found}) == 1
        print(f"{name:45}{'equal' if same else 'DIFFERENT':>12}", flush=True)
        return
    medians = [float(np.median(found)) for found in several]
    ratio = f"{medians[0] / medians[1]:12.3f}" if len(medians) == 2 else ""
    print(f"{name:45}" + "".join(f"{median:12.4g}" for median in medians) + ratio, flush=True)


PARTS: dict[str, list[Callable[[Path, int], Figures]]] = {
    "movement": [partial(lambda name, *of: measured(of[0], name, of[1]), name) for name in LEARNERS],
    "practice": [partial(lambda name, *of: measured(of[0], name, of[1]), name) for name in ROBOTS],
    "resume": [resume],
    "life": [long_life],
}
MOVEMENTS = {"movement": 2000, "practice": 2000, "resume": 5000, "life": 100_000}


def main() -> int:
    """Measure, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--against", type=Path, help="folder of another checkout of this repository")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--rounds", type=PositiveInt, default=3, help="measurements of each figure (3)")
    parser.add_argument("--movements", type=PositiveInt, help=f"of each life ({MOVEMENTS})")
    parser.add_argument("--child", choices=(*LEARNERS, *ROBOTS), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        live = practised if options.child in ROBOTS else life_of
        print(json.dumps(live(options.child, options.movements)))
        return 0
    if options.against is not None and not (options.against / "sgimd_torch").is_dir():
        parser.error(f"--against must be a folder with sgimd_torch in it, got {options.against}")
    libraries = [HERE] if options.against is None else [HERE, options.against.resolve()]
    print(f"{'':45}{'here':>12}" + ("" if options.against is None else f"{'there':>12}{'here/there':>12}"))
    work = [(measure, options.movements or MOVEMENTS[part]) for part in options.only for measure in PARTS[part]]
    with tqdm(total=len(work) * options.rounds * len(libraries), leave=False, disable=None) as progress:
        for measure, movements in work:
            figures: list[list[Figures]] = [[] for _ in libraries]
            for _ in range(options.rounds):
                for library, several in zip(libraries, figures, strict=True):
                    several.append(measure(library, movements))
                    progress.update()
            for name in figures[0][0]:
                show(name, [[one[name] for one in several] for several in figures])
    return 0


if __name__ == "__main__":
    sys.exit(main())
