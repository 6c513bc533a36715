"""Save the life of a learner, and let a new one repeat it: ``save_life(learner, path)``, ``load_life(new, path)``."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import suppress

from sgimd_torch import __version__
from sgimd_torch.files import replacing
from sgimd_torch.learner import Learner
from sgimd_torch.learner.events import Kind
from sgimd_torch.parts import Teacher
from sgimd_torch.record import Record, ReplayError, RunError
from sgimd_torch.record.replay import repeats_exactly, replay
from sgimd_torch.spaces import Episode, Move


def save_life(learner: Learner, path: str | os.PathLike[str]) -> None:
    """Write the life of a learner to a record: contexts, movements, rests, outcomes and lessons, in SQLite.

    A movement whose outcome was not told yet is left out: after `load_life`, ask for this movement again.

    Raises:
        ValueError: exemplars entered the memory without `Learner.add`, so no learner could repeat this life.
        OSError: ``path`` is a directory, a pipe, a device or a run, or cannot be written.
    """
    counted = {Kind.MOVED, Kind.ADDED, *([Kind.SHOWN] if learner.social and learner.social.remembers else [])}
    lived = learner.begun + sum(event.kind in counted for event in learner.events())
    if len(learner.memory) != lived:
        raise ValueError(
            f"the memory has {len(learner.memory)} exemplars, but {lived} were lived; were some added without "
            "learner.add(), which records them?"
        )
    with suppress(RunError), Record(path) as before:
        if "settings" in before.about:
            raise OSError(f"{path} is the record of a run, which no life replaces; choose another file")
    about = {"begun": learner.begun, "seed": learner.seed, "versions": {"sgimd_torch": __version__}}
    with replacing(path, record=True) as partial, Record.make(partial, learner.problem.dims, about) as record:
        for event in learner.events():
            record.add(event)
        record.commit()


def load_life(
    learner: Learner,
    path: str | os.PathLike[str],
    *,
    teacher: Teacher | None = None,
    after: Callable[[Move | None], object] | None = None,
) -> None:
    """Let a learner repeat a saved life or the life of a run; it can then go on as if the life had never stopped.

    Args:
        learner: learner freshly built from the same parts.
        path: file that `save_life` wrote, or the ``run.sqlite`` of a run.
        teacher: teacher freshly built, if it draws at random: it is asked before each movement, as in `run`, so that
            its draws go on in the same way. None: nobody is asked.
        after: function that gets each movement, None at a rest, such as the refresh of a forward model in your loop.

    Raises:
        ReplayError: this learner makes another movement. It has then lived a part of that life; build a new learner.
        RuntimeError: the learner has lived already.
        RunError: there is no record at ``path``, or it is of another robot, or damaged; then, too, build a new learner.
    """
    for episode in repeated(learner, path, teacher=teacher):
        if after is not None:
            after(episode.move)


def repeated(learner: Learner, path: str | os.PathLike[str], *, teacher: Teacher | None = None) -> Iterator[Episode]:
    """Let a learner repeat a saved life, one movement for each episode that is taken; see `load_life`."""
    if any(learner.events()) or not learner.idle:
        raise RuntimeError("load_life() needs a learner freshly built; this one has lived already")
    dims = learner.problem.dims
    with Record(path) as record:
        if record.dims != dims:
            raise RunError(f"{path} has dims {record.dims} of context, theta, outcome, not {dims}; another robot?")
        begun = record.about.get("begun", 0)
        if begun != learner.begun:
            raise ReplayError(f"{path} began with {begun} exemplars in memory, this learner began with {learner.begun}")
        if (seed := record.about.get("seed", learner.seed)) != learner.seed:
            raise ReplayError(f"{path} is the life of a learner with seed {seed}, this learner has seed {learner.seed}")
        exact = repeats_exactly(record.about, learner)
        yield from replay(learner, record.events(), teacher=teacher, exact=exact)
