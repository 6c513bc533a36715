"""Going on with a run: refuse what is not its beginning, keep what is whole, say what is not."""

from __future__ import annotations

import shutil
from itertools import count
from pathlib import Path
from typing import Any, Final

from sgimd_torch.record import DERIVED, Dims, InUseError, Record, RunError
from sgimd_torch.runs.config import EVALUATES, MAY_CHANGE, Config
from sgimd_torch.runs.evaluations import EVALUATED

OF_MODEL: Final = ("predictions", "refreshes")  # tables of a forward model


def reopened(
    path: Path, about: dict[str, Any], dims: Dims, config: Config, accept_loss: bool, notes: list[str]
) -> Record | None:
    """The record at ``path``, open for writing, without what the replay makes again; None if nothing can be read.

    Args:
        path: of the record.
        about, dims: what makes the run now; the versions of earlier parts are added.
        config: of the run.
        accept_loss: go on even if movements of it are damaged or missing: a copy is kept.
        notes: gets messages for the user.

    Raises:
        RunError: see ``open_run``.
    """
    record = _readable(path, accept_loss, notes)
    if record is None:
        return None
    try:
        differ = _refuse_other(record, about, dims)
        record = _whole(record, accept_loss, notes)
        if record.movements > config.movements:
            raise RunError(f"{path} has {record.movements} movements already, {config.movements} were asked for")
        made = list(dict.fromkeys(movements for movements, *_ in record.rows("evaluations")))
        others = made != config.evaluations[: len(made)] or differ & {*EVALUATES}
        for table in (*OF_MODEL, *EVALUATED * bool(others)):
            record.replace_rows(table, ())
        about["versions"] = _with_earlier(record.about["versions"], about["versions"], notes)
        record.settle(**about)
    except BaseException:
        record.close()
        raise
    return record


def _readable(path: Path, accept_loss: bool, notes: list[str]) -> Record | None:
    """The record at ``path``, open for writing; None if nothing of it can be read."""
    try:
        return Record(path, write=True)
    except InUseError:
        raise
    except RunError as error:
        _accept(path, f"{error}; nothing of it can be read", "make them", accept_loss, notes)
        path.unlink()
        return None


def _refuse_other(record: Record, about: dict[str, Any], dims: Dims) -> set[str]:
    """Refuse what is not the beginning of this run; the names of the settings that differ, but may."""
    if "settings" not in record.about:
        raise RunError(f"{record.path} is a life that Learner.save wrote, not a run; choose another --out")
    before, now = ({**each["settings"], **each["files"]} for each in (record.about, about))
    differ = [name for name in dict.fromkeys((*now, *before)) if before.get(name) != now.get(name)]
    if changed := [name for name in differ if name not in MAY_CHANGE]:
        raise RunError(
            f"{record.path.parent} belongs to another configuration: "
            f"{'; '.join(f'{name} was {before.get(name)}, now {now.get(name)}' for name in changed)}. "
            "Resume it with its own, or give the new variant another --name or --out"
        )
    if record.dims != dims:
        was = f"dims {record.dims} of context, theta, outcome, the robot now has {dims}"
        raise RunError(f"{record.path} was recorded with {was}; has the robot become another one?")
    return {*differ}


def _whole(record: Record, accept_loss: bool, notes: list[str]) -> Record:
    """The record without what is damaged."""
    wrong, path = record.check(), record.path
    if not wrong:
        return record
    notes += [f"{message}; it is made again" for table, message in wrong.items() if table in DERIVED]
    lost = [message for table, message in wrong.items() if table not in DERIVED]
    if not lost:
        return record.rewrite()
    record.close()  # to copy it while it is open would give up its lock
    _accept(path, "; ".join(lost), "keep those before and make the others", accept_loss, notes)
    record = Record(path, write=True).rewrite()
    notes.append(f"{record.movements} movements of {path} are kept, the others are made again")
    return record


def _accept(path: Path, what: str, how: str, accept_loss: bool, notes: list[str]) -> None:
    """Keep a copy of a record that loses movements, or refuse to go on."""
    if not accept_loss:
        raise RunError(f"{what} Restore it, or {how} again with --resume --accept-loss, which keeps a copy")
    copy = next(place for k in count() if not (place := path.with_name(f"run.lost-{k}.sqlite")).exists())
    shutil.copy2(path, copy)
    notes.append(f"{what} It is kept as {copy}")


def _with_earlier(old: dict[str, Any], now: dict[str, Any], notes: list[str]) -> dict[str, Any]:
    """The versions ``now``; those of earlier parts of the run, where they differ, are kept beside them."""
    earlier = old.pop("before", [])
    differ = [name for name, version in now.items() if old.get(name) != version]
    if differ:
        changes = ", ".join(f"{name} {old.get(name)} -> {now[name]}" for name in differ)
        notes.append(f"resumed with other versions: {changes}; only new movements and evaluations are by these")
        earlier = [*earlier, old]
    return {**now, "before": earlier} if earlier else now
