"""The engine of a cluster: each run is a Ray task on one core, which returns the record of the run.

No shared folder is needed. A task works in a temporary folder of its node. It receives the record made so far and
returns the new one. If a node dies, Ray repeats its tasks on other nodes, with the same records.
    with on_ray("auto") as submit: failures = sweep(configs, submit)
"""

from __future__ import annotations

import logging
import os
import signal
import socket
import sqlite3
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

os.environ["RAY_USAGE_STATS_ENABLED"] = "0"  # Ray reads this when it is imported

import ray
from ray.exceptions import RayError

from sgimd_torch.files import make_folder, write_bytes
from sgimd_torch.runs.config import FILES, Config
from sgimd_torch.runs.directory import FILE
from sgimd_torch.runs.engines.loop import Submit, check_end, log_of, run_words
from sgimd_torch.runs.process import SIGNALS, Failed

CONNECT_WITHIN: Final = 10.0  # s, longest wait for the cluster
STORE: Final = 100 * 2**20  # bytes of Ray's object store, by default a third of the memory
# A process must not outlive its killed task: prctl(PR_SET_PDEATHSIG, SIGKILL).
PROGRAM: Final = (
    ("-c", "import ctypes, runpy; ctypes.CDLL(None).prctl(1, 9); runpy.run_module('sgimd_torch', run_name='__main__')")
    if sys.platform == "linux"
    else ("-m", "sgimd_torch")
)


Ended = tuple[int, bytes, bytes | None]
"""The result of a task: exit code and output of its process, and the record of the run (None: there is none)."""


@contextmanager
def on_ray(address: str | None, processes: int = 1, *, ships: bool = False, out: Path = Path()) -> Iterator[Submit]:
    """An engine: tasks of a Ray cluster.

    Args:
        address: ``host:port`` of a cluster that this machine belongs to, or ``auto``; None starts one on this machine.
        processes: number of runs at a time in a cluster that is started here.
        ships: whether to send a copy of the working directory, for runs that import the user's code from it.
        out: folder that is not sent; files that .gitignore names are not sent, either.

    Raises:
        ValueError: the cluster cannot be used; or ``ships`` is true and a space in the path of Python would stop Ray.
    """
    options: dict[str, Any] = {}
    if ships:
        if " " in sys.executable:
            raise ValueError(
                f"Ray cannot start Python from a path with a space, {sys.executable}, for runs with your own parts; "
                "move the virtual environment, or omit --engine ray"
            )
        options["runtime_env"] = {"working_dir": os.getcwd(), "excludes": [f"/{os.path.relpath(out)}"]}
    heard = {signum: signal.getsignal(signum) for signum in SIGNALS}
    try:
        _connect(address, processes, options)
    finally:
        for signum, handler in heard.items():  # Ray has installed its own handlers
            signal.signal(signum, handler)
    # Ray repeats a task only if its node or its worker process dies. A run that fails ends its task.
    task: Any = ray.remote(num_cpus=1, max_retries=-1)(carry_out)

    def submit(config: Config, flags: Sequence[str]) -> Future[None]:
        future = Future[None]()

        def end(returned: Future[Ended]) -> None:
            try:
                _keep(config, returned.result())
            except RayError as lost:
                future.set_exception(Failed(f"Ray lost the run: {_in_one_line(lost)}"))
            except (Failed, ValueError, OSError) as error:
                future.set_exception(error)
            else:
                future.set_result(None)

        away = replace(config, out=Path("runs"))
        record = f"{away.directory}/{FILE}"
        try:
            files = {str(config[name]): config[name].read_bytes() for name in FILES if config[name] is not None}
            if (config.directory / FILE).exists():
                files[record] = _snapshot(config.directory / FILE)
        except (OSError, sqlite3.Error) as error:
            future.set_exception(ValueError(f"its files cannot be sent: {error}"))
        else:
            task.remote(run_words(away, flags), record, files).future().add_done_callback(end)
        return future

    try:
        yield submit
    finally:
        ray.shutdown()  # shutdown kills tasks, too


def carry_out(words: Sequence[str], record: str, files: Mapping[str, bytes]) -> Ended:
    """The task: a run in a temporary folder of this node.

    Args:
        words: command line of the run, without ``sgimd``.
        record: path of the record within the folder.
        files: contents of the files to put there first, by path within the folder.
    """
    with TemporaryDirectory(prefix="sgimd-") as folder:
        for name, content in files.items():
            path = Path(folder, name)
            make_folder(path.parent)
            path.write_bytes(content)
        command = [sys.executable, *PROGRAM, *words]
        done = subprocess.run(
            command, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        made = Path(folder, record)
        return done.returncode, done.stdout, made.read_bytes() if made.exists() else None


def _keep(config: Config, ended: Ended) -> None:
    """Write the log and the record that a task returned; raise the errors of ``check_end``."""
    code, said, record = ended
    make_folder(config.directory)
    with log_of(config).open("ab") as log:
        log.write(said)
    if record is not None:
        write_bytes(config.directory / FILE, record)
    check_end(config, code, said)


def _snapshot(path: Path) -> bytes:
    """The content of a record as of its last commit, even if its process was killed before the next one."""
    with closing(sqlite3.connect(path)) as connection:
        return connection.serialize()


def _connect(address: str | None, processes: int, options: Mapping[str, Any]) -> None:
    """Connect to the cluster at ``address``, or start one here.

    Raises:
        ValueError: there is no cluster, or it cannot be used.
    """
    logging.getLogger("ray").setLevel(logging.ERROR)
    if address is None:
        options = {**options, "num_cpus": processes, "object_store_memory": STORE, "include_dashboard": False}
    elif address != "auto":
        host, _, port = address.rpartition(":")
        try:
            socket.create_connection((host, int(port)), CONNECT_WITHIN).close()  # Ray would try for minutes
        except (OSError, OverflowError, ValueError) as error:
            hint = "--address is host:port of its head, or auto on one of its nodes; is the cluster running?"
            raise ValueError(f"no Ray cluster answers at {address}: {error}; {hint}") from error
    try:
        ray.init(address or "local", log_to_driver=False, configure_logging=False, **options)
    except (ConnectionError, RuntimeError, ValueError, RayError) as error:
        raise ValueError(f"Ray cannot be used here: {_in_one_line(error)}") from error


def _in_one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:400]
