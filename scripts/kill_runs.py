"""Kill runs at moments drawn by lot and resume them: is every file in the end that of a run which nobody disturbed?

    scripts/kill_runs.py --kills 40 --seed 0                 # a table, exit status 1 for any fault; some minutes
    scripts/kill_runs.py --kills 6 --only arm --keep killed  # of one robot, and keep the folders of its runs
A run is killed (SIGKILL) at a moment of its life, again at a moment of its resumption, then resumed to its end. Three
lots choose a moment: in which sort of part of a run, in which part of that sort, and how much of it is over. A run says
when a part begins, so the table counts the parts in which the kills fell. In the end all csv and json files must be
equal, but for seconds, and the board must hold every point once, with its tag, step and value, but for seconds.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import zlib
from collections import Counter
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from tqdm import tqdm

from damage import pick
from options import at_least

ROOT: Final = Path(__file__).resolve().parents[1]
FIXED: Final = (
    "--seed 1000 --board true --name run --out runs"  # relative, so that equal runs say the same of themselves
)
PLACE: Final = "runs/run/seed-1000"
ROD: Final = "--movements 240 --evaluate-at 70,150 --repeats 2 --benchmark goals.npz"
RUNS: Final = {
    "rod": ROD,
    "rod, model": f"{ROD} --inverse model",
    "arm": "--environment planar-arm-7 --movements 2500 --evaluate-at 800,1700 --repeats 0",
    "arm, model": "--environment planar-arm-7 --movements 1200 --evaluate-at 400,800 --repeats 0 --inverse model",
}
PARTS: Final = ("start", "movements", "evaluation", "refresh", "end", "replay")


class Part(NamedTuple):
    """A part of a run: which of ``PARTS``, and when it began (s)."""

    name: str
    begun: float


def child(descriptor: int, words: Sequence[str]) -> int:
    """Be ``sgimd run``, and write to ``descriptor`` when a part of the run begins. Returns the exit code."""
    from sgimd_torch.runs import command_line, process, run

    now = ""

    def begin(part: str) -> None:
        nonlocal now
        now = part
        os.write(descriptor, f"{part} {time.monotonic()}\n".encode())

    def telling(owner: Any, name: str, part: str, then: str = "") -> None:
        function: Callable[..., Any] = getattr(owner, name)

        def call(*arguments: Any, **options: Any) -> Any:
            if part and not (now == "replay" and then):  # what a replay repeats belongs to it
                begin(part)
            found = function(*arguments, **options)
            if then and (now == part or not part):
                begin(then)
            return found

        setattr(owner, name, call)

    telling(run, "RunDirectory", "replay" if "--resume" in words else "start")
    telling(run.Life, "_begin", "", "movements")
    telling(run.Life, "_evaluate", "evaluation", "movements")
    telling(process.Progress, "__exit__", "end")
    if "model" in words:
        from sgimd_torch.forward_model.training import OnlineTrainer

        telling(OnlineTrainer, "fit", "refresh", "movements")
    return process.command(command_line.main, words)


def live(folder: Path, words: str, kill: tuple[str, int, float] | None = None) -> tuple[int, list[Part], str]:
    """Run in ``folder``, in a process of its own.

    Args:
        folder: the working directory.
        words: the options.
        kill: in which part, which one of that sort, and how many seconds after it has begun; None lets the run end.

    Returns:
        The exit code, the parts that have begun and, last, the end of the process, and what it said.
    """
    reading, writing = os.pipe()
    command = [sys.executable, __file__, "--child", str(writing), *words.split()]
    environment, parts = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}, list[Part]()
    with subprocess.Popen(
        command, cwd=folder, env=environment, pass_fds=[writing], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    ) as process:
        os.close(writing)
        with os.fdopen(reading) as told:
            for line in told:
                name, begun = line.split()
                parts.append(Part(name, float(begun)))
                if kill is not None and kill[:2] == (name, sum(part.name == name for part in parts) - 1):
                    time.sleep(max(0.0, parts[-1].begun + kill[2] - time.monotonic()))
                    process.kill()
        said = process.communicate()[1].decode()
    return process.returncode, [*parts, Part("", time.monotonic())], said


def contents(run: Path) -> dict[str, Any]:
    """What must be equal: files by name, points of the board by tag and step."""
    from tensorboard.backend.event_processing.event_file_loader import EventFileLoader

    found: dict[str, Any] = {}
    for path in sorted(run.iterdir()):
        if path.name.startswith("events."):
            for event in EventFileLoader(str(path)).Load():
                for value in event.summary.value:
                    if not value.tag.startswith("time/"):  # replayed movements have no seconds
                        point = f"{value.tag} at {event.step}"
                        again = ", again" if point in found else ""
                        found[point + again] = value.tensor.SerializeToString()
        elif path.suffix == ".json":
            content = json.loads(path.read_bytes())
            found[path.name] = {name: value for name, value in content.items() if not name.startswith("seconds_")}
        else:
            found[path.name] = path.read_bytes()
    return found


def differences(run: Path, whole: dict[str, Any]) -> list[str]:
    """Names of what is not equal in ``run`` and in the ``contents`` of another, or only in one of them."""
    found = contents(run)
    return [
        name
        for name in sorted({*found, *whole})
        if name not in found or name not in whole or found[name] != whole[name]
    ]


class Case:
    """One of ``RUNS``: it is run without disturbance first, then killed again and again."""

    def __init__(self, name: str, folder: Path, seed: int) -> None:
        self.words, self.folder = f"{FIXED} {RUNS[name]}", folder
        self.rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
        self.fell: Counter[str] = Counter()
        self.faults: list[str] = []
        self.runs = 0
        place = self._new_folder()
        code, parts, said = live(place, self.words)
        if code:
            sys.exit(f"{name}: the run that nobody disturbed ended with {code}: {said}")
        self.whole = contents(place / PLACE)
        self._lines = (place / PLACE / "episodes.csv").read_bytes().count(b"\n")
        parts += live(place, f"{self.words} --resume")[1]
        if wrong := differences(place / PLACE, self.whole):
            self.faults.append(f"{place}: resumed when it had ended: {', '.join(wrong)}")
        self._seconds: dict[str, list[float]] = {}
        for part, next_one in pairwise(parts):
            self._seconds.setdefault(part.name, []).append(next_one.begun - part.begun)

    def kill_a_run(self, most: int) -> int:
        """Kill a new run, at most so many times, and compare what is there when it has ended. Returns how often."""
        place, killed = self._new_folder(), 0
        for more in ("", " --resume")[:most]:
            code, parts, _ = live(place, self.words + more, self._moment(place / PLACE, bool(more)))
            if code != -signal.SIGKILL:  # it was over before
                break
            self.fell[parts[-2].name if len(parts) > 1 else "start"] += 1
            killed += 1
        code, _, said = live(place, f"{self.words} --resume")
        wrong = [f"exit code {code}: {said}"] if code else differences(place / PLACE, self.whole)
        if wrong:
            self.faults.append(f"{place}: {', '.join(wrong)}")
        return killed

    def _moment(self, run: Path, resumed: bool) -> tuple[str, int, float]:
        """Drawn by lot. A replay takes as much less time as its log is shorter."""
        part = pick(
            [name for name in PARTS if name in self._seconds and name != ("start" if resumed else "replay")], self.rng
        )
        seconds, log = self._seconds[part], run / "episodes.csv"
        which = 0 if resumed else int(self.rng.integers(len(seconds)))
        share = log.read_bytes().count(b"\n") / self._lines if part == "replay" and log.exists() else 1.0
        return part, which, float(self.rng.random()) * seconds[which] * share

    def _new_folder(self) -> Path:
        from sgimd_torch.evaluation import Benchmark, save_benchmark

        place = self.folder / f"{self.runs:03d}"
        self.runs += 1
        place.mkdir(parents=True)
        goals = np.random.default_rng(0).uniform(-0.5, 0.5, (8, 2))
        save_benchmark(place / "goals.npz", Benchmark("FishingRod", goals, 0.1))
        return place


def main() -> int:
    """Kill the runs of the command line, and say what came of it."""
    if sys.argv[1:2] == ["--child"]:
        return child(int(sys.argv[2]), sys.argv[3:])
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=at_least(1), default=40, help="in all (default: %(default)s)")
    parser.add_argument("--seed", type=at_least(0), default=0, help="of the lots (default: %(default)s)")
    parser.add_argument("--only", nargs="+", choices=RUNS, default=list(RUNS), metavar="RUN", help=", ".join(RUNS))
    parser.add_argument("--keep", type=Path, help="a new folder for the runs")
    options = parser.parse_args()
    if options.keep is not None and options.keep.exists():
        parser.error(f"--keep must be a new folder, {options.keep} exists")
    folder = Path(tempfile.mkdtemp()) if options.keep is None else options.keep.absolute()
    faults: list[str] = []
    print(f"| run | kills | {' | '.join(PARTS)} | runs | files | points of the board | runs with a difference |")
    print("|---" * (len(PARTS) + 6) + "|")
    try:
        with tqdm(total=options.kills, unit=" kills", leave=False, disable=None) as progress:
            for number, name in enumerate(options.only):
                progress.set_description(name)
                case = Case(name, folder / name.replace(", ", "-"), options.seed)
                kills = len(range(number, options.kills, len(options.only)))
                while (left := kills - case.fell.total()) > 0:
                    progress.update(case.kill_a_run(left))
                points = sum(" at " in entry for entry in case.whole)
                counts = (case.fell[part] for part in PARTS)
                fields = (name, kills, *counts, case.runs, len(case.whole) - points, points, len(case.faults))
                print(f"| {' | '.join(map(str, fields))} |", flush=True)
                faults += case.faults
    finally:
        if options.keep is None:
            shutil.rmtree(folder)
    for fault in faults:
        print(fault, file=sys.stderr)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
