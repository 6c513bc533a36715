"""Take rooms away: copy the tree without a room of sgimd_torch/extras, and run the tests of the core there.

  python scripts/without_rooms.py                 # each room in turn, then all of them together; an hour or two
  python scripts/without_rooms.py film all        # without film, then without any room

Exit code: 0 all tests passed, 1 some failed.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from sgimd_torch.rooms import rooms

ROOT = Path(__file__).parents[1]
OF_THE_CORE = [
    *("board", "demonstrations", "environments", "forward_model", "goals", "inverses", "learner", "memory", "options"),
    *("record", "runs", "searches", "teachers"),
]
# An editable installation would still find the room where this script is.
SITE = "import sys; sys.meta_path[:] = [finder for finder in sys.meta_path if 'editable' not in str(finder)]\n"


def passes(room: str, folder: Path) -> bool:
    """Whether the tests of the core pass without this ``room``, or without "all", in a copy in ``folder``."""
    for name in ("sgimd_torch", "tests", "experiments"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", folder)
    (folder / "sitecustomize.py").write_text(SITE)
    for name in rooms() if room == "all" else [room]:
        shutil.rmtree(folder / "sgimd_torch/extras" / name)
    tests = [f"tests/{name}" for name in OF_THE_CORE] + [str(path) for path in (folder / "tests").glob("test_*.py")]
    words = ["-q", "-n", "auto", "-m", "not slow", "-p", "no:cacheprovider", "--dist", "worksteal", *tests]
    environment = {**os.environ, "PYTHONPATH": str(folder), "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": ""}
    done = subprocess.run([sys.executable, "-m", "pytest", *words], cwd=folder, env=environment)
    return done.returncode == 0


def main() -> int:
    """Run the tests; returns the exit code."""
    if "--help" in sys.argv[1:]:
        print(__doc__)
        return 0
    chosen = sys.argv[1:] or [*rooms(), "all"]
    if unknown := {*chosen} - {*rooms(), "all"}:
        raise SystemExit(f"error: there is no room {', '.join(unknown)}; known are {', '.join(rooms())}, all")
    failed = []
    for room in chosen:
        print(f"without {room}:", flush=True)
        with TemporaryDirectory() as folder:
            failed += [] if passes(room, Path(folder)) else [room]
    print(
        f"{len(chosen) - len(failed)} of {len(chosen)} passed" + f"; failed without {', '.join(failed)}" * bool(failed)
    )
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())
