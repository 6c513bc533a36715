"""Damage thousands of files and load them: is every change refused by name, in bounded time and memory?

    scripts/fuzz_loaders.py --files 10000 --seed 0                   # all loaders; a table, exit status 1 for any fault
    scripts/fuzz_loaders.py --files 300 --loaders model --keep bad   # and keep the files that showed a fault
Four of five files are damaged (`damage.damaged`); they must be refused, or hold what the file held before. One of five
is another file in the same format whose checksums are right; it must be refused, or hold finite numbers. A process of
its own loads them, which may not take more memory or time for a file than stated; a warning counts as a fault, too. Of
a run directory one file is changed at a time. There a damaged table may be read up to the damage, if `Run.damage` says
so, and one cut at the end of a line reads as the run did when it was under way. Its json files have no checksum: a
value of them that is another is counted as "json".
"""

from __future__ import annotations

import argparse
import contextlib
import multiprocessing
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final

import numpy as np

from damage import Change, damaged, pick, rewritten_model, rewritten_npz, rewritten_text
from options import at_least
from sgimd_torch.demonstrations import load_demonstrations, save_demonstrations
from sgimd_torch.evaluation import Benchmark, load_benchmark, save_benchmark
from sgimd_torch.forward_model.model import ForwardModel
from sgimd_torch.memory import Memory
from sgimd_torch.runs import command_line, process
from sgimd_torch.runs.read import read_run
from sgimd_torch.spaces import Demonstration

SECONDS: Final = 5  # a file
MEBIBYTES: Final = 512  # of address space, above what the process has before
GOOD: Final = ("refused", "the same", "told", "as earlier", "json", "another valid file")
_NO_ROWS: Final = np.empty(0, dtype=np.str_)
FAULTS: Final = ("changed unnoticed", "traceback", "out of time", "out of memory")


@dataclass(frozen=True)
class Loader:
    """``save`` writes a good file or folder, ``load`` gives its content as arrays by "file:name", ``rewritten`` makes
    another file. With "file:told" in its content, the loader has said that the file is damaged."""

    save: Callable[[Path], None]
    load: Callable[[Path], dict[str, Any]]
    rewritten: Change


def _save_benchmark(path: Path) -> None:
    save_benchmark(path, Benchmark("FishingRod", np.random.default_rng(0).uniform(-1, 1, (20, 2)), 0.1))


def _save_demonstrations(path: Path) -> None:
    rng = np.random.default_rng(0)
    recordings = [
        Demonstration(rng.normal(size=1), np.arange(n) / 50, rng.normal(size=(n, 3)), rng.normal(size=2))
        for n in (2, 5, 9, 30)
    ]
    save_demonstrations(path, recordings)


def _load_demonstrations(path: Path) -> dict[str, Any]:
    recordings = enumerate(load_demonstrations(path))
    return {f"{part} of {k}": values for k, recording in recordings for part, values in vars(recording).items()}


def _save_memory(path: Path) -> None:
    rng, memory = np.random.default_rng(0), Memory(1, 4, 2, context_weight=0.5)
    for _ in range(30):
        memory.add(rng.normal(size=1), rng.random(4), rng.normal(size=2))
    memory.save(path)


def _load_memory(path: Path) -> dict[str, Any]:
    memory = Memory.load(path)
    return {name: getattr(memory, name) for name in ("contexts", "thetas", "outcomes", "context_weight")}


def _save_life(path: Path) -> None:
    from sgimd_torch.algorithms import observation, random_exploration
    from sgimd_torch.environments.planar_arm import PlanarArm
    from sgimd_torch.spaces import Demonstration, stream

    arm = PlanarArm(3, context=True)
    learner = random_exploration(arm, 0)
    watching = observation(arm, 0, correspondence=arm.correspondence)
    learner.social, learner.correspondence = watching.social, watching.correspondence
    lesson = Demonstration(np.zeros(1), np.arange(4) / 50, np.full((4, 3), 0.5), np.zeros(2))
    for k in range(20):
        context = arm.observe(stream(k, "context"))
        move = learner.ask(context)
        assert move is not None
        learner.tell(arm.execute(context, move.theta, stream(k, "environment")))
        if k % 5 == 0:
            learner.watch(lesson)
            learner.ask(context)
            learner.interrupt()
    learner.save(path)


def _load_life(path: Path) -> dict[str, Any]:
    from sgimd_torch.learner.life import read_life
    from sgimd_torch.memory import Memory

    life = read_life(path, Memory(1, 3, 2))
    found: dict[str, Any] = {"begun": life.begun, "crc32": life.memory_crc32}
    for k, event in enumerate(life.events):
        lesson = () if event.lesson is None else vars(event.lesson).items()
        parts = [*event._asdict().items(), *lesson]
        found |= {f"{name} of {k}": part for name, part in parts if part is not None and name != "lesson"}
    return found


def _save_model(path: Path) -> None:
    rng, memory = np.random.default_rng(0), Memory(0, 3, 2)
    for theta in rng.random((60, 3)):
        memory.add(np.zeros(0), theta, theta[:2])
    model = ForwardModel(0, 3, 2, members=2, hidden=(5,))
    model.refresh(memory)
    model.save(path)


def _load_model(path: Path) -> dict[str, Any]:
    model = ForwardModel.load(path)
    state = {name: values.numpy() for name, values in model.state_dict().items()}
    return {**state, "about": str({**model.sizes, **model.shape})}


def _save_run(path: Path) -> None:
    words = (
        "--environment planar-arm-7 --inverse model --movements 120 --evaluate_at 60,120 --repeats 0 --name run --out"
    )
    with open(os.devnull, "w") as nothing, contextlib.redirect_stdout(nothing), contextlib.redirect_stderr(nothing):
        code = process.command(command_line.main, [*words.split(), str(path.parent / "runs")])
    assert code == 0
    shutil.move(path.parent / "runs/run/seed-000", path)


def _load_run(path: Path) -> dict[str, Any]:
    run = read_run(path)
    log = ("index", "origin", "demonstration", "contexts", "thetas", "goals", "outcomes")
    tables = {name: getattr(run, name) or {} for name in ("evaluation", "regions", "predictions", "refreshes")}
    tables |= {"episodes": {name: getattr(run, name) for name in log}}
    found = {
        f"{table}.csv:{name}": values.astype(str) for table, each in tables.items() for name, values in each.items()
    }
    for name in ("config", "versions", "summary"):
        found |= {f"{name}.json:{key}": str(value) for key, value in getattr(run, name).items()}
    return found | {f"{name}:told": "" for name in (*run.damage, *run.unchecked)}


LOADERS: Final = {
    "benchmark": Loader(_save_benchmark, lambda path: vars(load_benchmark(path)), rewritten_npz),
    "demonstrations": Loader(_save_demonstrations, _load_demonstrations, rewritten_npz),
    "memory": Loader(_save_memory, _load_memory, rewritten_npz),
    "life": Loader(_save_life, _load_life, rewritten_npz),
    "model": Loader(_save_model, _load_model, rewritten_model),
    "run": Loader(_save_run, _load_run, rewritten_text),
}


def files_of(path: Path) -> dict[Path, bytes]:
    """The files of a loader, with their content, in order."""
    files = [path] if path.is_file() else sorted(file for file in path.iterdir() if file.name != "lock")
    return {file: file.read_bytes() for file in files}


def changed(name: str, whole: dict[Path, bytes], seed: int, index: int) -> tuple[Path, bytes, bool]:
    """Change ``index`` of a seed: of which file, its new content, and whether it is damage rather than another file."""
    rng = np.random.default_rng([seed, zlib.crc32(name.encode()), index])
    path = pick(list(whole), rng)
    change = LOADERS[name].rewritten if index % 5 == 4 else damaged
    return path, change(whole[path], rng), change is damaged


def judge(loader: Loader, path: Path, good: dict[str, Any], is_damaged: bool) -> str:
    """What came of a file: one of ``GOOD`` or ``FAULTS``."""
    try:
        content = loader.load(path)
    except MemoryError:
        return "out of memory"
    except ValueError as error:
        if str(path) in str(error):
            return "refused"
        traceback.print_exc()
        return "traceback"  # of another library: nobody would know which file it was
    except Exception:
        traceback.print_exc()
        return "traceback"
    differ = {name for name in {*good, *content} if not name.endswith(":told") and not _equal(good, content, name)}
    if not differ:
        return "the same"
    if all(_earlier(content.get(name, _NO_ROWS), good.get(name, _NO_ROWS)) for name in differ):
        return "told" if all(f"{name.partition(':')[0]}:told" in content for name in differ) else "as earlier"
    if all(".json:" in name for name in differ):
        return "json"
    numbers = [array for array in map(np.asarray, content.values()) if array.dtype.kind in "fiu"]
    return (
        "changed unnoticed" if is_damaged or not all(map(np.all, map(np.isfinite, numbers))) else "another valid file"
    )


def _equal(good: dict[str, Any], content: dict[str, Any], name: str) -> bool:
    if name not in good or name not in content:
        return False
    one, other = np.asarray(good[name]), np.asarray(content[name])
    return one.shape == other.shape and one.tolist() == other.tolist()


def _earlier(shorter: Any, longer: Any) -> bool:
    """Whether a column of a table holds the first entries of another."""
    one, other = np.asarray(shorter), np.asarray(longer)
    return min(one.ndim, other.ndim) > 0 and one.dtype.kind == "U" and one.tolist() == other[: len(one)].tolist()


def child(name: str, path: Path, parent: Connection) -> None:
    """Make a good file, then load what is there whenever the parent asks, and send what came of it."""
    loader = LOADERS[name]
    loader.save(path)
    good = loader.load(path)
    warnings.simplefilter("error")
    held = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (held + MEBIBYTES * 2**20,) * 2)
    before = _peak()
    parent.send("ready")
    with contextlib.suppress(EOFError):  # the parent has closed its end
        while True:
            is_damaged = parent.recv()
            signal.setitimer(signal.ITIMER_REAL, SECONDS)  # nobody handles this signal: it ends the process
            begun = time.perf_counter()
            verdict = judge(loader, path, good, is_damaged)
            seconds = time.perf_counter() - begun
            signal.setitimer(signal.ITIMER_REAL, 0)
            parent.send((verdict, seconds, _peak() - before))


def _peak() -> int:
    """The most memory (KiB) that this process has held; the system's own count takes that of its parent for it."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))


def verdicts(name: str, files: int, seed: int, keep: Path | None) -> Iterator[tuple[str, float, int]]:
    """What came of each file, the seconds it took, and the memory (KiB) that the process needed so far to load."""
    done = 0
    while done < files:
        with tempfile.TemporaryDirectory() as folder, _started(name, Path(folder) / "saved") as (loading, pipe):
            pipe.recv()
            whole = files_of(Path(folder) / "saved")
            while done < files and loading.is_alive():
                path, content, is_damaged = changed(name, whole, seed, done)
                path.write_bytes(content)
                pipe.send(is_damaged)
                try:
                    verdict, seconds, memory = pipe.recv()
                except EOFError:
                    loading.join()
                    if loading.exitcode != -signal.SIGALRM:
                        sys.exit(f"{name}: the process that loads ended with {loading.exitcode} at file {done}")
                    verdict, seconds, memory = "out of time", SECONDS, 0
                yield verdict, seconds, memory
                if keep is not None and verdict in FAULTS:
                    keep.mkdir(parents=True, exist_ok=True)
                    (keep / f"{name}-{done}-{path.name}").write_bytes(content)
                path.write_bytes(whole[path])
                done += 1


@contextlib.contextmanager
def _started(name: str, path: Path) -> Iterator[tuple[multiprocessing.process.BaseProcess, Connection]]:
    os.environ["OMP_NUM_THREADS"] = "1"
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    loading = context.Process(target=child, args=(name, path, theirs))
    loading.start()
    theirs.close()  # so that its end is noticed
    try:
        yield loading, ours
    finally:
        ours.close()
        loading.join()


def main() -> None:
    """Fuzz the loaders of the command line, and say what came of it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--files", type=at_least(1), default=10_000, help="for each loader (default: %(default)s)")
    parser.add_argument("--seed", type=at_least(0), default=0, help="of all changes (default: %(default)s)")
    parser.add_argument("--loaders", nargs="+", choices=LOADERS, default=list(LOADERS), help="(default: all)")
    parser.add_argument("--keep", type=Path, help="a folder for the files that show a fault")
    options = parser.parse_args()
    print("| loader | files | " + " | ".join((*GOOD, *FAULTS)) + " | slowest (ms) | memory (MiB) |")
    print("|---" * (len(GOOD) + len(FAULTS) + 4) + "|")
    faults = 0
    for name in options.loaders:
        counts: Counter[str] = Counter()
        slowest, memory = 0.0, 0
        for verdict, seconds, held in verdicts(name, options.files, options.seed, options.keep):
            counts[verdict] += 1
            slowest, memory = max(slowest, seconds), max(memory, held)
        each = (counts[verdict] for verdict in (*GOOD, *FAULTS))
        fields = (name, counts.total(), *each, round(1000 * slowest), round(memory / 1024))
        print("| " + " | ".join(map(str, fields)) + " |", flush=True)
        faults += sum(counts[verdict] for verdict in FAULTS)
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    main()
