"""Stands in for the record and the life of ``runs/run.py`` until they are there; goes then. Not a design."""

import os
import pickle
from dataclasses import replace
from types import SimpleNamespace

from sgimd_torch.files import write_bytes, write_json
from sgimd_torch.runs.clock import Seconds
from sgimd_torch.runs.directory import RunDirectory
from sgimd_torch.runs.process import Stopping, say
from sgimd_torch.runs.run import Life as TodaysLife
from sgimd_torch.teachers.by_hand import BY_HAND, ByHand

FILE = "run.sqlite"


class Record:
    def __init__(self, path, *, write=False):
        self.path = path
        self.shown = pickle.loads(path.read_bytes()) if path.exists() else []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def events(self):
        log = self.path.with_name("episodes.csv")
        n = max(0, len(log.read_bytes().splitlines()) - 1) if log.exists() else 0
        for index in range(n + 1):
            for at, asked, _ in self.shown:
                if at == index:
                    if asked:
                        yield SimpleNamespace(kind="asked", who=BY_HAND)
                    yield SimpleNamespace(kind="shown", who=BY_HAND)
            if index < n:
                yield SimpleNamespace(kind="moved", who=None)

    def cut(self, n):
        events = list(self.events())[:n]
        movements = sum(event.kind == "moved" for event in events)
        self.shown = self.shown[: sum(event.kind == "shown" for event in events)]
        folder, log = self.path.parent, self.path.with_name("episodes.csv")
        write_bytes(log, b"".join(log.read_bytes().splitlines(keepends=True)[: movements + 1]))
        import json

        summary = json.loads((folder / "summary.json").read_text())
        write_json(folder / "summary.json", {**summary, "movements": movements, "finished": False})
        self.path.write_bytes(pickle.dumps(self.shown))


class Life:
    def __init__(self, parts):
        self.path = parts.config.directory
        self._record = Record(self.path / FILE)
        self._hand, self._parts = parts.teacher, parts
        shown = [lesson for *_, lesson in self._record.shown]
        parts = replace(
            parts,
            teacher=self,
            teachers={name: self if isinstance(each, ByHand) else each for name, each in parts.teachers.items()},
            demonstrations=[*parts.demonstrations, *shown],
        )
        self._index = -1
        directory = RunDirectory(parts, resume=(self.path / "config.json").exists())
        say(*parts.notes, *directory.notes)
        self._life = TodaysLife(directory, parts, Stopping(), Seconds(directory.summary), None)
        self._life._awaited = lambda name, each: each
        self.recorded = self._life.recorded
        self._known = {at: (asked, lesson) for at, asked, lesson in self._record.shown}

    def offer(self, index, memory):
        self._index = index
        offered = self._hand.offer(index, memory)
        asked, lesson = self._known.get(index, (True, None))
        if not asked:
            return lesson
        if self._hand.who == BY_HAND:
            self._keep(offered, False)
        return offered

    def demonstrate(self, context, goal, memory):
        if self._index in self._known:
            return self._known[self._index][1]
        lesson = self._hand.demonstrate(context, goal, memory)
        if lesson is not None:
            self._keep(lesson, True)
        return lesson

    def _keep(self, lesson, asked):
        self._life.add_demonstration(lesson)
        self._record.shown.append((self._index, asked, lesson))

    movements = property(lambda self: self._life.movements)
    replaying = property(lambda self: self._life.replaying)

    def episodes(self):
        return self._life.episodes()

    def commit(self):
        self._life.summarise()
        (self.path / "part").write_bytes(pickle.dumps(self._record.shown))
        os.replace(self.path / "part", self.path / FILE)

    def close(self):
        try:
            if not self.replaying:
                self.commit()
                self._life.summarise(finished=self.movements == self._parts.config.movements)
        finally:
            self._life.directory.__exit__()
