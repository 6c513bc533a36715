"""From words of a command line to the settings of a run.

config, resume = parse(["--algorithm", "sgim-d", "--seed=3", "--resume"])
"""

from __future__ import annotations

from collections.abc import Sequence

from sgimd_torch.options.config import Config


def parse(argv: Sequence[str], description: str | None = None) -> tuple[Config, bool]:
    """The run that a command line describes, and whether to resume it.

    Raises:
        ValueError: a word belongs to no option, or a value is wrong.
        SystemExit: code 0, after ``--help``.
    """
    try:
        texts, flags = _read(argv)
        if "help" in flags:
            from sgimd_torch.options.help import help_on, overview  # runs need no help

            print(help_on(texts) if texts else overview(description))
            raise SystemExit(0)
        return Config.from_settings(texts), "resume" in flags
    except ValueError as error:
        raise ValueError(f"{error}\n--help explains all options") from error


def _read(argv: Sequence[str]) -> tuple[dict[str, str], set[str]]:
    """The text of each option by its name, and the flags.

    Raises:
        ValueError: a word belongs to no option, or an option has no value.
    """
    texts, flags, waiting = dict[str, str](), set[str](), [*argv]
    while waiting:
        word, equals, text = waiting.pop(0).partition("=")
        name = word.removeprefix("--").replace("-", "_")
        if word in ("-h", "--help", "--resume") and not equals:
            flags.add("resume" if word == "--resume" else "help")
        elif not word.startswith("--"):
            what = "an option begins with -- and takes one value, a flag such as --resume none"
            raise ValueError(f"{word!r} belongs to no option; {what}")
        elif word in ("--help", "--resume"):
            raise ValueError(f"{word} takes no value, got {text!r}")
        elif equals:
            texts[name] = text
        elif waiting and not waiting[0].startswith("--"):
            texts[name] = waiting.pop(0)
        else:
            raise ValueError(f"{word} needs a value")
    return texts, flags
