"""The engine of a cluster: each run is a task of Ray, on one core.

Run directories are written on the machine where the sweep was started; no folder has to be shared, see ``parcels.py``.
When a node dies, Ray starts its tasks on others, and the runs go on from what was sent.
    with OnRay("auto") as engine: failures = sweep(configs, engine)
"""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, Self, cast

os.environ["RAY_USAGE_STATS_ENABLED"] = "0"  # read when Ray is imported

import ray
from ray.exceptions import RayError, RayTaskError
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from sgimd_torch.runs.config import Config
from sgimd_torch.runs.engines.local import LOOK_EVERY, PATIENCE, Job
from sgimd_torch.runs.engines.parcels import Keeper, carry_out
from sgimd_torch.runs.process import SIGNALS, Failed

ANSWER_WITHIN: Final = 30.0  # s, for a cluster
STORE: Final = 100 * 2**20  # bytes, for what is on its way; Ray would take a third of the memory
SEND_EVERY: Final = 5.0  # s; what a run loses at most when its node dies, and how long it may take to hear of Ctrl-C
# A process whose task was killed must not go on alone: prctl(PR_SET_PDEATHSIG, SIGKILL).
PROGRAM: Final = (
    ("-c", "import ctypes, runpy; ctypes.CDLL(None).prctl(1, 9); runpy.run_module('sgimd_torch', run_name='__main__')")
    if sys.platform == "linux"
    else ("-m", "sgimd_torch")
)


class OnRay:
    """An ``Engine``: tasks of a Ray cluster.

    Args:
        address: ``host:port`` of a cluster that this machine belongs to, or ``auto``; None starts one on this machine.
        processes: how many run at a time, of a cluster that is started here.
        ships: send a copy of the working directory along, which the runs import from.
        out: a folder that is not sent; neither is what .gitignore names.

    Raises:
        ValueError: the working directory is to be sent, and the path of Python has a space: Ray would wait for ever.
    """

    def __init__(self, address: str | None, processes: int = 1, *, ships: bool = False, out: Path = Path()) -> None:
        self._address, self._processes = address, processes
        if ships and " " in sys.executable:
            raise ValueError(
                f"Ray cannot start Python from a path with a space, {sys.executable}, for runs with parts of your own; "
                "put the virtual environment elsewhere, or leave --engine ray out"
            )
        sent = {"working_dir": os.getcwd(), "excludes": [f"/{os.path.relpath(out)}"]}
        self._options: dict[str, Any] = {"runtime_env": sent} if ships else {}
        self._jobs: dict[Path, Job] = {}

    def __enter__(self) -> Self:
        heard = {signum: signal.getsignal(signum) for signum in SIGNALS}
        try:
            _connect(self._address, self._processes, self._options)
        finally:
            for signum, handler in heard.items():  # Ray has its own
                signal.signal(signum, handler)
        here = NodeAffinitySchedulingStrategy(ray.get_runtime_context().get_node_id(), soft=False)
        self._actor: Any = ray.remote(Keeper).options(num_cpus=0, scheduling_strategy=here).remote(os.getcwd())
        self._keeper = cast(Keeper, _Distant(self._actor))
        # Only the death of a node, or of the task's own process, starts a task again. A run that fails ends its task.
        self._task: Any = ray.remote(num_cpus=1, max_retries=-1)(_carry_out)
        return self

    def __exit__(self, *_: object) -> None:
        try:
            with suppress(RayError):
                self._keeper.stop()
                deadline = time.monotonic() + SEND_EVERY + PATIENCE
                while "running" in self._keeper.states().values() and time.monotonic() < deadline:
                    time.sleep(LOOK_EVERY)
        finally:
            ray.shutdown()

    def submit(self, job: Job) -> Future[None]:
        """A task for it."""
        self._jobs[job.config.directory] = job
        future = Future[None]()

        def end(done: Future[Exception | None]) -> None:
            try:
                error = done.result()
            except RayError as lost:
                error = Failed(f"Ray has lost it: {_in_one_line(lost)}")
            if error is None:
                future.set_result(None)
            else:
                future.set_exception(error)

        self._task.remote(self._actor, job.config, job.flags, SEND_EVERY).future().add_done_callback(end)
        return future

    def refresh(self) -> None:
        """Ask the keeper which runs are under way."""
        try:
            states = self._keeper.states()
        except RayError as error:
            raise Failed(f"the Ray cluster is gone: {_in_one_line(error)}") from error
        for directory, state in states.items():
            job = self._jobs[directory]
            if state == "held":
                job.hold()
            elif job.state in ("waiting", "held"):
                job.state = state


class _Distant:
    """An object on another machine: its methods are called there."""

    def __init__(self, actor: Any) -> None:
        self._actor = actor

    def __getattr__(self, name: str) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            try:  # not by ray.get: while a task waits there, Ray gives its core to another one
                return getattr(self._actor, name).remote(*arguments).future().result()
            except RayTaskError as error:
                raise error.cause from None  # as it was raised there

        return call


def _carry_out(actor: Any, config: Config, flags: Sequence[str], every: float) -> Exception | None:
    """The task. It returns what went wrong: what is raised, Ray wraps."""
    return carry_out(cast(Keeper, _Distant(actor)), config, flags, PROGRAM, every)


def _connect(address: str | None, processes: int, options: Mapping[str, Any]) -> None:
    """To the cluster at ``address``, or to one that is started here.

    Raises:
        ValueError: there is none, or it cannot be used.
    """
    if "://" in (address or ""):
        raise ValueError(f"--address must be host:port, or auto, got {address}; start the sweep on a node of it")
    if address is not None:
        _try(address)
    logging.getLogger("ray").setLevel(logging.ERROR)
    if address is None:
        options = {**options, "num_cpus": processes, "object_store_memory": STORE, "include_dashboard": False}
    try:
        ray.init(address or "local", log_to_driver=False, configure_logging=False, **options)
    except (ConnectionError, RuntimeError, ValueError, RayError) as error:
        raise ValueError(f"Ray cannot be used here: {_in_one_line(error)}") from error


def _try(address: str) -> None:
    """Connect to a cluster from another process: where nothing answers, Ray would try for minutes and then abort."""
    words = [sys.executable, "-c", "import ray, sys; ray.init(sys.argv[1], log_to_driver=False)", address]
    try:
        tried = subprocess.run(words, capture_output=True, text=True, timeout=ANSWER_WITHIN)
    except subprocess.TimeoutExpired as error:
        slip = "is its head running, and is this the port of ray start?"
        raise ValueError(f"no Ray cluster answers at {address} within {ANSWER_WITHIN:g} s; {slip}") from error
    if tried.returncode:
        why = tried.stderr.strip().rpartition("\n")[2][:400] or f"it ended with {tried.returncode}"
        raise ValueError(f"no Ray cluster can be used at {address}: {why}")


def _in_one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:400]
