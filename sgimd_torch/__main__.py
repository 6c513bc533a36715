"""The program ``sgimd``, also ``python -m sgimd_torch``; it loads only the module of the command that is called."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Sequence
from typing import Final

from sgimd_torch import __version__
from sgimd_torch.options.catalogue import WORDS, about
from sgimd_torch.rooms import absent, room_of, rooms
from sgimd_torch.runs.program import ONE_THREAD, command
from sgimd_torch.runs.signals import loading
from sgimd_torch.texts import unknown_name_error

HELP: Final = f"""usage: sgimd COMMAND [OPTIONS]

Robots learn movements for goals by curiosity and by imitating a teacher
(SGIM-D; Nguyen & Oudeyer, 2014).

commands:
{"".join(f"  {name:16}{about('command', name)}{chr(10)}" for name in WORDS["command"])}
examples:
  sgimd run --algorithm sgim-d --seed 3              one run of 5000 movements, into runs/sgim-d/seed-003
  sgimd run --algorithm sgim-d --seed 3 --resume     go on with this run after Ctrl-C or a power cut
  sgimd run --environment mypackage.toss:make        one run on this robot
  sgimd run --help                                   all options and parts

sgimd COMMAND --help explains a command; sgimd --version prints the version."""


def main() -> int:
    """Run the command that the first argument names, and return the exit code."""
    for name, threads in ONE_THREAD.items():
        os.environ.setdefault(name, threads)
    return command(_call)


def _call(words: Sequence[str]) -> int:
    name = words[0] if words else "--help"
    if name in ("-h", "--help"):
        print(HELP)
        return 0 if words else 2
    if words == ["--version"]:
        print(f"sgimd_torch {__version__}")
        return 0
    if name not in WORDS["command"]:
        meant = f"; sgimd --help explains them (perhaps {absent(name)})"
        raise unknown_name_error("command", name, WORDS["command"], meant)
    try:
        with loading():
            module = importlib.import_module(f"sgimd_torch.{WORDS['command'][name]}")
        return int(module.main(words[1:]))
    except ModuleNotFoundError as error:
        install = getattr(rooms().get(room_of(WORDS["command"][name])), "INSTALL", "")
        if not install:
            raise
        hint = f"pip install 'sgimd-torch[{install}]' installs it"
        raise ImportError(f"sgimd {name} needs {error.name}, which is not installed; {hint}") from error


if __name__ == "__main__":
    sys.exit(main())
