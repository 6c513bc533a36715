"""What travels between a run on a distant node and its directory at home: both ends of it, without the network between.

A task works in a temporary folder of its node. It begins with what there is of its run and sends what is new every few
seconds to a ``Keeper`` at home, which writes it. A task that is started again begins with what was sent.
    error = carry_out(keeper, config, flags, program, every=3.0)
"""

from __future__ import annotations

import json
import os
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple

from sgimd_torch.files import lock, make_folder, write_bytes
from sgimd_torch.runs.config import FILES, Config, plain
from sgimd_torch.runs.engines.local import LOOK_EVERY, Job
from sgimd_torch.runs.process import Failed

ORDER: Final = {"summary.json": 0, "episodes.csv": 2}  # in which the files of a run are read; 1: all others
Parts = dict[str, tuple[int, bytes] | None]
"""By its path below --out: what is new in a file, and after how many bytes that comes; None: the file is gone."""


class Start(NamedTuple):
    """What a task begins with: its ``turn``, the ``files`` of the run by their paths below --out, and the files that
    options name, by option (``inputs``)."""

    turn: int
    files: dict[str, bytes]
    inputs: dict[str, bytes]


class Keeper:
    """Writes what tasks send of their runs, on the machine of the sweep; one for all tasks.

    It holds the locks of their directories, so that no other sweep writes there at the same time.

    Args:
        home: the working directory of the sweep.
    """

    def __init__(self, home: str) -> None:
        os.chdir(home)
        self._locks: dict[Path, int] = {}
        self._held: set[Path] = set()
        self._turns: Counter[Path] = Counter()
        self._stopping = False

    def begin(self, config: Config) -> Start | None:
        """A task begins with a run; None: it has to wait.

        The lock of a run whose task was started again is ours already: the new task takes its turn.

        Raises:
            OSError: the directory of the run cannot be made, or a file cannot be read.
        """
        directory = config.directory
        if self._stopping:
            return None
        if directory not in self._locks:
            make_folder(directory)
            try:
                self._locks[directory] = lock(directory / "lock")
            except BlockingIOError:
                self._held.add(directory)
                return None
        self._held.discard(directory)
        self._turns[directory] += 1
        named = {option: getattr(config, option) for option in FILES}
        inputs = {option: path.read_bytes() for option, path in named.items() if path is not None}
        return Start(self._turns[directory], contents(config), inputs)

    def keep(self, config: Config, turn: int, parts: Parts) -> bool:
        """Write what is new; False if the task has to stop.

        Raises:
            OSError: it cannot be written.
        """
        if turn != self._turns[config.directory]:  # its node was taken for dead, and the run goes on elsewhere
            return False
        for name, part in parts.items():
            path = config.out / name
            if part is None:
                path.unlink(missing_ok=True)
            elif part[0]:
                with path.open("ab") as file:
                    file.write(part[1])
            else:
                make_folder(path.parent)
                write_bytes(path, part[1])
        return not self._stopping

    def end(self, config: Config, turn: int) -> None:
        """The task has ended."""
        if turn == self._turns[config.directory]:
            os.close(self._locks.pop(config.directory))

    def states(self) -> dict[Path, str]:
        """Of the runs that are under way, or held by another process; by directory."""
        return {**dict.fromkeys(self._locks, "running"), **dict.fromkeys(self._held, "held")}

    def stop(self) -> None:
        """All tasks stop when they send the next time, and no other begins."""
        self._stopping = True


class Parcel:
    """The files of one run on the node of its task, as they were sent.

    Args:
        keeper: to whom they are sent.
        config: of the run, as it was asked for.
        folder: an empty one of this node.
        every: seconds from one sending to the next.

    Attributes:
        config: the same run in this folder.
    """

    def __init__(self, keeper: Keeper, config: Config, folder: Path, every: float) -> None:
        self._keeper, self._asked, self._folder, self._every = keeper, config, folder, every
        while (begun := keeper.begin(config)) is None:
            time.sleep(LOOK_EVERY)
        self._turn, self._sent, inputs = begun
        for name, content in {**self._sent, **inputs}.items():
            make_folder((folder / name).parent)
            (folder / name).write_bytes(content)
        there: dict[str, Any] = {"out": folder, **{option: folder / option for option in inputs}}
        self.config = replace(config, **there)
        self._last, self._wanted = time.monotonic(), True

    def stopped(self) -> bool:
        """Whether the run has to stop; sends what is new, now and then."""
        if time.monotonic() - self._last >= self._every:
            self.send()
        return not self._wanted

    def send(self) -> None:
        """Send what is new, the log first and the summary last."""
        now = {name: self._told(name, content) for name, content in contents(self.config).items()}
        parts: Parts = dict.fromkeys(self._sent.keys() - now.keys())
        for name, content in reversed(now.items()):
            before = self._sent.get(name)
            if content != before:
                start = len(before) if before and content.startswith(before) else 0
                parts[name] = (start, content[start:])
        self._wanted = self._keeper.keep(self._asked, self._turn, parts)
        self._sent, self._last = now, time.monotonic()

    def end(self) -> None:
        """Send the rest."""
        self.send()
        self._keeper.end(self._asked, self._turn)

    def here(self, text: str) -> str:
        """A message of the run, with the paths that the user knows."""
        return text.replace(str(self._folder), str(self._asked.out))

    def _told(self, name: str, content: bytes) -> bytes:
        """A file as it is kept: with the paths that the user knows."""
        if name.endswith("/config.json"):
            places = {option: plain(getattr(self._asked, option)) for option in ("out", *FILES)}
            return (json.dumps({**json.loads(content), **places}, indent=2) + "\n").encode()
        return self.here(content.decode(errors="replace")).encode() if name.endswith(".log") else content


def contents(config: Config) -> dict[str, bytes]:
    """The files of a run, by their paths below --out.

    The summary is read first and the log last, so that the log lacks nothing that the others count.
    """
    found = [*config.directory.rglob("*"), config.directory.with_suffix(".log")]
    paths = [path for path in found if path.is_file() and path.name != "lock" and path.suffix != ".part"]
    read = {}
    for path in sorted(paths, key=lambda path: ORDER.get(path.name, 1)):
        with suppress(FileNotFoundError):  # it was there only for a moment
            read[path.relative_to(config.out).as_posix()] = path.read_bytes()
    return read


def carry_out(
    keeper: Keeper, config: Config, flags: Sequence[str], program: Sequence[str], every: float
) -> Exception | None:
    """Carry out one run in a temporary folder of this node; what went wrong, if anything.

    Args:
        keeper: has what there is of the run, and gets what is new.
        config, flags, program: see ``Job``.
        every: seconds from one sending to the next.
    """
    with TemporaryDirectory(prefix="sgimd-") as folder:
        try:
            parcel = Parcel(keeper, config, Path(folder), every)
            try:
                Job(parcel.config, flags, program).carry_out(parcel.stopped)
            except (Failed, ValueError, OSError) as error:
                return type(error)(parcel.here(str(error)))
            finally:
                parcel.end()
        except (ValueError, OSError) as error:
            return error
    return None
