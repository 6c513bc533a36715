"""Loads the modules whose functions numba compiles; without this, numba would be loaded with the package.

kernels = compiled("sgimd_torch.inverses.kernels"); kernels.answer(...)
Numba compiles once for each processor and version, and keeps what it compiled beside the module, or in the cache folder
of the user if the package cannot be written to, or where ``NUMBA_CACHE_DIR`` says. Two processes may compile at once.
scripts/setup compiles all, by `compile_all`.
"""

from __future__ import annotations

import importlib
import subprocess
import sys
import tempfile
from functools import cache
from types import ModuleType
from typing import Any


@cache
def compiled(name: str) -> ModuleType:
    """The module of this ``name``. If its functions have to be compiled first, a line on stderr says so."""
    import numba
    from numba.core import event

    class Telling(event.Listener):
        def on_start(self, event: Any) -> None:
            _tell()

        def on_end(self, event: Any) -> None:
            pass

    with event.install_listener("numba:compile", Telling()):
        try:
            return importlib.import_module(name)
        except RuntimeError as error:
            if "cannot cache" not in str(error):
                raise
            # No folder can be written to, not even the user's; so this process compiles for itself alone.
            numba.config.CACHE_DIR = _own_folder().name  # type: ignore[attr-defined]
            return importlib.import_module(name)


def compile_all() -> None:
    """Compile all functions that are not in the cache yet, in one process for each module."""
    names = ("inverses.kernels", "inverses.linear_kernel", "memory.scan", "changes.kernels")
    programs = [f"from {__name__} import compiled; compiled('sgimd_torch.{name}')" for name in names]
    _tell()
    running = [subprocess.Popen([sys.executable, "-c", each], stderr=subprocess.PIPE, text=True) for each in programs]
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
