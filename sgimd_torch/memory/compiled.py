"""Loads the modules whose functions numba compiles; without this, numba would be loaded with the package.

kernels = compiled("sgimd_torch.inverses.kernels"); kernels.answer(...)
Numba keeps what it compiles for each processor and version. It notices changes of a file, but not of the files that
this file imports. So its folder has a checksum of all files in ``MODULES`` as its name. The folder lies beside this
module, or in the cache folder of the user if the package cannot be written to, or where ``NUMBA_CACHE_DIR`` says.
"""

from __future__ import annotations

import importlib
import shutil
import subprocess
import sys
import tempfile
import zlib
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, Final

# All files with compiled functions; changes of a file that is missing here would not change the checksum.
MODULES: Final = ("memory.jit", "memory.ordered", "inverses.tuples", "inverses.linear_kernel", "inverses.kernels")
_PACKAGE: Final = Path(__file__).parents[1]


@cache
def compiled(name: str) -> ModuleType:
    """The module of this ``name``. If its functions have to be compiled first, a line on stderr says so."""
    from numba import config
    from numba.core import event

    class Telling(event.Listener):
        def on_start(self, event: Any) -> None:
            _tell()

        def on_end(self, event: Any) -> None:
            pass

    chosen, folder = config.CACHE_DIR, _folder(config.CACHE_DIR)  # type: ignore[attr-defined]
    config.CACHE_DIR = folder  # type: ignore[attr-defined]
    try:
        with event.install_listener("numba:compile", Telling()):
            try:
                return importlib.import_module(name)
            except ImportError:
                raise
            except Exception:  # what is kept may be damaged: pickle raises many kinds; any other error comes again
                shutil.rmtree(folder, ignore_errors=True)
                return importlib.import_module(name)
    finally:
        config.CACHE_DIR = chosen  # type: ignore[attr-defined]


def compile_all() -> None:
    """Compile all functions that are not kept yet, half of them in a second process."""
    *names, largest = (f"sgimd_torch.{name}" for name in MODULES)
    program = f"from {__name__} import compiled; compiled({largest!r})"
    with subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.DEVNULL):
        for name in names:
            compiled(name)
    compiled(largest)  # if the second process failed, its error is raised here


@cache
def _folder(chosen: str) -> str:
    """A folder for what is compiled from the present sources, in the ``chosen`` folder if there is one."""
    from numba.misc.appdirs import user_cache_dir

    sources = [(_PACKAGE / name.replace(".", "/")).with_suffix(".py").read_bytes() for name in MODULES]
    for parent in [chosen] if chosen else [_PACKAGE / "memory" / "__pycache__", user_cache_dir("sgimd_torch")]:  # type: ignore[no-untyped-call]
        folder = Path(parent) / f"compiled-{zlib.crc32(b''.join(sources)):08x}"
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                return str(folder)
    return _own_folder().name  # no folder can be written to, so it is compiled for this process alone


@cache
def _own_folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="numba-")


@cache
def _tell() -> None:
    print("compiling once, about 20 s", file=sys.stderr, flush=True)
