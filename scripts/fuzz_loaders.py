"""Damage thousands of files and load them: is every change refused by name, in bounded time and memory?

    scripts/fuzz_loaders.py --files 10000 --seed 0                   # all loaders; a table, exit status 1 for any fault
    scripts/fuzz_loaders.py --files 300 --loaders model --keep bad   # and keep the files that showed a fault
Four of five files are damaged (`damage.damaged`); they must be refused, or hold what the file held before. One of five
is another file in the same format whose checksums are right; it must be refused, or hold finite numbers. A process of
its own loads them, which may not take more memory or time for a file than stated, and which ends at a warning, too.
"""

from __future__ import annotations

import argparse
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from damage import Change, damaged, rewritten_model, rewritten_npz
from options import at_least

ROOT = Path(__file__).resolve().parent.parent
SECONDS: Final = 5  # a file
MEBIBYTES: Final = 1024  # of address space, above what the process has before
GOOD: Final = ("refused", "the same", "another valid file")
FAULTS: Final = ("changed unnoticed", "traceback", "out of time", "out of memory")


@dataclass(frozen=True)
class Loader:
    """``save`` writes a good file, ``load`` gives its content as arrays by name, ``rewritten`` makes another file."""

    save: Callable[[Path], None]
    load: Callable[[Path], dict[str, Any]]
    rewritten: Change


def _save_benchmark(path: Path) -> None:
    from sgimd_torch.evaluation import Benchmark, save_benchmark

    save_benchmark(path, Benchmark("FishingRod", np.random.default_rng(0).uniform(-1, 1, (20, 2)), 0.1))


def _load_benchmark(path: Path) -> dict[str, Any]:
    from sgimd_torch.evaluation import load_benchmark

    benchmark = load_benchmark(path)
    return {"environment": benchmark.environment, "goals": benchmark.goals, "side": benchmark.side}


def _save_demonstrations(path: Path) -> None:
    from sgimd_torch.demonstrations import save_demonstrations
    from sgimd_torch.spaces import Demonstration

    rng = np.random.default_rng(0)
    recordings = [
        Demonstration(rng.normal(size=1), np.arange(n) / 50, rng.normal(size=(n, 3)), rng.normal(size=2))
        for n in (2, 5, 9, 30)
    ]
    save_demonstrations(path, recordings)


def _load_demonstrations(path: Path) -> dict[str, Any]:
    from sgimd_torch.demonstrations import load_demonstrations

    return {
        f"{part} of {k}": getattr(recording, part)
        for k, recording in enumerate(load_demonstrations(path))
        for part in ("context", "times", "trajectory", "outcome")
    }


def _save_memory(path: Path) -> None:
    from sgimd_torch.memory import Memory

    rng, memory = np.random.default_rng(0), Memory(1, 4, 2, context_weight=0.5)
    for _ in range(30):
        memory.add(rng.normal(size=1), rng.random(4), rng.normal(size=2))
    memory.save(path)


def _load_memory(path: Path) -> dict[str, Any]:
    from sgimd_torch.memory import Memory

    memory = Memory.load(path)
    names = ("contexts", "thetas", "outcomes", "context_weight")
    return {name: getattr(memory, name) for name in names}


def _save_model(path: Path) -> None:
    from sgimd_torch.forward_model.model import ForwardModel
    from sgimd_torch.memory import Memory

    rng, memory = np.random.default_rng(0), Memory(0, 3, 2)
    for theta in rng.random((60, 3)):
        memory.add(np.zeros(0), theta, theta[:2])
    model = ForwardModel(0, 3, 2, members=2, hidden=(5,))
    model.refresh(memory)
    model.save(path)


def _load_model(path: Path) -> dict[str, Any]:
    from sgimd_torch.forward_model.model import ForwardModel

    model = ForwardModel.load(path)
    state = {name: values.numpy() for name, values in model.state_dict().items()}
    return {**state, "about": str({**model.sizes, **model.shape})}


LOADERS: Final = {
    "benchmark": Loader(_save_benchmark, _load_benchmark, rewritten_npz),
    "demonstrations": Loader(_save_demonstrations, _load_demonstrations, rewritten_npz),
    "memory": Loader(_save_memory, _load_memory, rewritten_npz),
    "model": Loader(_save_model, _load_model, rewritten_model),
}


def fuzzed(loader: Loader, good: bytes, name: str, seed: int, index: int) -> tuple[bytes, bool]:
    """File ``index`` of a seed, and whether it is damaged; otherwise it is another file."""
    rng = np.random.default_rng([seed, zlib.crc32(name.encode()), index])
    change = loader.rewritten if index % 5 == 4 else damaged
    return change(good, rng), change is damaged


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
    if _bytes_of(content) == _bytes_of(good):
        return "the same"
    numbers = [value for value in content.values() if not isinstance(value, str)]
    if not is_damaged and all(np.isfinite(value).all() for value in numbers):
        return "another valid file"
    return "changed unnoticed"


def _bytes_of(content: dict[str, Any]) -> dict[str, tuple[Any, ...]]:
    arrays = {name: np.asarray(value) for name, value in content.items()}
    return {name: (array.dtype, array.shape, array.tobytes()) for name, array in arrays.items()}


def child(name: str, first: int, files: int, seed: int) -> None:
    """Load them one after another; prints what came of each. A file out of time ends the process."""
    loader = LOADERS[name]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "file"
        loader.save(path)
        whole, good = path.read_bytes(), loader.load(path)
        warnings.simplefilter("error")
        held = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (held + MEBIBYTES * 2**20,) * 2)
        for index in range(first, files):
            content, is_damaged = fuzzed(loader, whole, name, seed, index)
            path.write_bytes(content)
            del content
            begun = time.perf_counter()
            signal.setitimer(signal.ITIMER_REAL, SECONDS)  # nobody handles this signal: it ends the process
            verdict = judge(loader, path, good, is_damaged)
            signal.setitimer(signal.ITIMER_REAL, 0)
            print(f"{verdict}\t{time.perf_counter() - begun:.4f}", flush=True)
        print(f"peak\t{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss}", flush=True)


def verdicts(name: str, files: int, seed: int) -> Iterator[tuple[str, float]]:
    """What came of each file and the seconds it took; at the end "peak" and the memory (KiB) at its largest."""
    done = 0
    while done < files:
        words = [sys.executable, __file__, "--child", str(done), "--files", str(files), "--seed", str(seed)]
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
        process = subprocess.Popen([*words, "--loaders", name], stdout=subprocess.PIPE, text=True, env=environment)
        assert process.stdout is not None
        for line in process.stdout:
            verdict, number = line.split("\t")
            done += verdict != "peak"
            yield verdict, float(number)
        if process.wait() == -signal.SIGALRM:
            done += 1
            yield "out of time", SECONDS
        elif process.returncode:
            sys.exit(f"{name}: the process that loads ended with {process.returncode} at file {done}")


def main() -> None:
    """Fuzz the loaders of the command line, and say what came of it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--files", type=at_least(1), default=10_000, help="for each loader (default: %(default)s)")
    parser.add_argument("--seed", type=at_least(0), default=0, help="of all changes (default: %(default)s)")
    parser.add_argument("--loaders", nargs="+", choices=LOADERS, default=list(LOADERS), help="(default: all)")
    parser.add_argument("--keep", type=Path, help="a folder for the files that show a fault")
    parser.add_argument("--child", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child is not None:
        child(options.loaders[0], options.child, options.files, options.seed)
        return
    faults = 0
    print("| loader | files | " + " | ".join((*GOOD, *FAULTS)) + " | slowest (s) | memory (MiB) |")
    print("|---" * (len(GOOD) + len(FAULTS) + 4) + "|")
    for name in options.loaders:
        counts: Counter[str] = Counter()
        slowest = peak = 0.0
        for verdict, number in verdicts(name, options.files, options.seed):
            if verdict == "peak":
                peak = max(peak, number)
                continue
            if verdict in FAULTS and options.keep is not None:
                _keep(options.keep, name, options.seed, counts.total())
            counts[verdict] += 1
            slowest = max(slowest, number)
        fields = (
            name,
            counts.total(),
            *(counts[each] for each in (*GOOD, *FAULTS)),
            f"{slowest:.2f}",
            round(peak / 1024),
        )
        print("| " + " | ".join(map(str, fields)) + " |", flush=True)
        faults += sum(counts[each] for each in FAULTS)
    sys.exit(1 if faults else 0)


def _keep(folder: Path, name: str, seed: int, index: int) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}-{seed}-{index}"
    LOADERS[name].save(path)
    path.write_bytes(fuzzed(LOADERS[name], path.read_bytes(), name, seed, index)[0])


if __name__ == "__main__":
    main()
