"""Loads the modules whose functions numba compiles; without this, numba would be loaded with the package.

kernels = compiled("sgimd_torch.inverses.kernels"); kernels.answer(...)
Numba compiles once for each processor and version. It notices changes of a file, but not of the files that this file
imports. So the cache folder has a checksum of all files in ``MODULES`` as its name. It lies beside this module, or in
the cache folder of the user if the package cannot be written to, or where ``NUMBA_CACHE_DIR`` says. Two processes may
compile at once. The folder lists checksums of its files, as damaged machine code could end the process: a file that is
not as listed is removed, so it is made again.
"""

from __future__ import annotations

import fcntl
import importlib
import os
import subprocess
import sys
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, Final

# All files with compiled functions; changes of a file that is missing here would not change the checksum.
MODULES: Final = ("memory.jit", "memory.scan", "inverses.linear_kernel", "inverses.kernels")
_LIST: Final = "checksums"
_PACKAGE: Final = Path(__file__).parents[1]


@cache
def compiled(name: str) -> ModuleType:
    """The module of this ``name``. If its functions have to be compiled first, a line on stderr says so."""
    from numba import config
    from numba.core import event

    class Telling(event.Listener):
        told = False

        def on_start(self, event: Any) -> None:
            self.told = True
            _tell()

        def on_end(self, event: Any) -> None:
            pass

    folder, config.CACHE_DIR = config.CACHE_DIR, _folder(config.CACHE_DIR)  # type: ignore[attr-defined]
    try:
        with event.install_listener("numba:compile", telling := Telling()):
            module = importlib.import_module(name)
        if telling.told:
            _list_files(Path(config.CACHE_DIR))  # type: ignore[attr-defined]
        return module
    finally:
        config.CACHE_DIR = folder  # type: ignore[attr-defined]


def compile_all() -> None:
    """Compile all functions that are not in the cache yet, half of them in a second process."""
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
                _remove_damaged(folder)
                return str(folder)
    return _own_folder().name  # no folder can be written to, so it is compiled for this process alone


def _remove_damaged(folder: Path) -> None:
    """Remove all files that are not as they were listed."""
    checksums = folder / _LIST
    listed = checksums.read_text(encoding="utf-8", errors="replace").splitlines() if checksums.exists() else ()
    for path, line in _files(folder):
        if line not in listed:
            path.unlink(missing_ok=True)


def _list_files(folder: Path) -> None:
    held = os.open(folder, os.O_RDONLY)
    fcntl.flock(held, fcntl.LOCK_EX)  # else the list written last could be older than some of the files
    try:
        partial = folder / f"{os.getpid()}.part"
        partial.write_text("\n".join(line for _, line in _files(folder)), encoding="utf-8")
        partial.replace(folder / _LIST)
    finally:
        os.close(held)


def _files(folder: Path) -> Iterator[tuple[Path, str]]:
    """Each file of compiled functions, and its line in the list."""
    for path in folder.rglob("*.nb?"):
        with suppress(FileNotFoundError):  # another process removes it
            yield path, f"{zlib.crc32(path.read_bytes()):08x} {path.relative_to(folder)}"


@cache
def _own_folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="numba-")


@cache
def _tell() -> None:
    print("compiling once, about 20 s", file=sys.stderr, flush=True)
