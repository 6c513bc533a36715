"""Loads the modules whose functions numba compiles; without this, numba would be loaded with the package.

kernels = compiled("sgimd_torch.inverses.kernels"); kernels.answer(...)
Numba compiles once for each processor and version, and keeps what it compiled beside the module, or in the cache folder
of the user if the package cannot be written to, or where ``NUMBA_CACHE_DIR`` says. Two processes may compile at once.
Each module is compiled in a process of its own, because the last bits of results depend on what the process has
compiled before. scripts/setup compiles all, by `compile_all`.
"""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

_PROJECT = Path(__file__).parents[2]


class _NotCompiledError(RuntimeError):
    pass


@cache
def compiled(name: str) -> ModuleType:
    """The module of this ``name``. If its functions have to be compiled first, a line on stderr says so."""
    import numba
    from numba.core import event

    class Refusing(event.Listener):
        def on_start(self, event: Any) -> None:
            raise _NotCompiledError

        def on_end(self, event: Any) -> None:
            pass

    try:
        with event.install_listener("numba:compile", Refusing()):
            return importlib.import_module(name)
    except _NotCompiledError:
        pass
    except RuntimeError as error:
        if "cannot cache" not in str(error):
            raise
        # No folder can be written to, not even the user's; so it is compiled for this process alone.
        numba.config.CACHE_DIR = _own_folder().name  # type: ignore[attr-defined]
    _compile(name)
    return importlib.import_module(name)


def compile_all() -> None:
    """Compile all functions that are not in the cache yet."""
    names = ("inverses.kernels", "inverses.linear_kernel", "memory.scan", "changes.kernels")
    _compile(*(f"sgimd_torch.{name}" for name in names))


def _compile(*names: str) -> None:
    """Compile these modules side by side."""
    import numba

    _tell()
    where = {**os.environ, "NUMBA_CACHE_DIR": numba.config.CACHE_DIR}  # type: ignore[attr-defined]
    commands = [[sys.executable, "-c", f"import {name}"] for name in names]
    running = [subprocess.Popen(each, cwd=_PROJECT, env=where, stderr=subprocess.PIPE, text=True) for each in commands]
    for each in running:
        _, said = each.communicate()
        if each.returncode:
            raise RuntimeError(said)


@cache
def _tell() -> None:
    print("compiling once, about 15 s", file=sys.stderr, flush=True)


@cache
def _own_folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="numba-")
