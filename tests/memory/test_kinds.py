"""The memory is a part: three kinds in the catalogue, others of a user's own, which stay what they are."""

import copy
import math
import sys

import faiss
import numpy as np
import pytest

from sgimd_torch.algorithms.paper import sagg_riac
from sgimd_torch.algorithms.practice import practice
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.memory import FlatMemory, Memory, ScanMemory
from sgimd_torch.memory.growing import Growing
from sgimd_torch.memory.neighbours import Flat
from sgimd_torch.options.catalogue import WORDS
from sgimd_torch.options.config import Config
from sgimd_torch.runs.build import build
from sgimd_torch.runs.load import load_learner
from sgimd_torch.runs.run import RunLoop
from sgimd_torch.session import run

NONE = {"random", "observation", "imitation"}  # they have no goals of their own
OWN = """
import math
import numpy as np
from sgimd_torch.memory import Memory
from sgimd_torch.memory.growing import Growing
from sgimd_torch.memory.neighbours import Flat

class Last(Flat):
    def nearest(self, queries, k, within=math.inf):
        first = max(0, len(self.keys) - 30)
        rows = Flat(Growing(self.keys.dim, self.keys.rows[first:])).nearest(queries, k, within)
        return np.where(rows < 0, -1, rows + first)

class LastThirty(Memory):
    def index(self, keys):
        return Last(keys)
"""
# Learners that ask an inverse model; archives of quality diversity have cells in place of neighbours.
SEARCHING = sorted(
    name for name, at in WORDS["algorithm"].items() if "quality_diversity" not in at and name not in NONE
)
ARM = PlanarArm(3, noise=0.01)


@pytest.fixture
def own(tmp_path, monkeypatch):
    """The module of a user, with a memory of the last thirty exemplars."""
    (tmp_path / "remembering.py").write_text(OWN)
    monkeypatch.syspath_prepend(tmp_path)
    yield __import__("remembering")
    sys.modules.pop("remembering")


def live(learner, movements=60):
    for _ in run(learner, ARM, learner.problem.seed, movements=movements):
        pass
    return learner


def test_a_life_is_the_same_with_every_kind_but_for_rounding():
    thetas = [live(practice(ARM, 0, memory=kind)).memory.thetas for kind in (Memory, FlatMemory, ScanMemory)]
    assert np.array_equal(thetas[0], thetas[1])
    assert thetas[2] == pytest.approx(thetas[0], abs=1e-6)


@pytest.mark.parametrize("given", ["class", "memory"])
def test_a_users_memory_stays_what_it_is(own, given):
    memory = own.LastThirty if given == "class" else own.LastThirty(0, 3, 2)
    learner = live(sagg_riac(ARM, 0, memory=memory))
    for kept in (learner.memory, learner.problem.memory, learner.memory.copy(), copy.deepcopy(learner.memory)):
        assert type(kept) is own.LastThirty
        assert min(kept.near_outcomes([], [0.5, 0.5], 10)) >= len(kept) - 30


def test_a_run_with_it_is_recorded_resumed_and_loaded(own, tmp_path):
    settings = {"environment": "planar-arm-7", "memory": "remembering:LastThirty", "evaluate_at": (), "repeats": 0}
    for movements in (40, 60):
        config = Config.from_settings({**settings, "algorithm": "practice", "movements": movements, "out": tmp_path})
        with RunLoop(build(config), resume=movements > 40) as life:
            assert len(list(life.episodes())) > 0
            lived = life.parts.learner
    loaded = load_learner(config.directory, trust=True)
    assert type(loaded.memory) is own.LastThirty
    goal = np.array([0.3, 0.4])
    assert np.array_equal(loaded.inverse(np.zeros(0), goal).theta, lived.inverse(np.zeros(0), goal).theta)


class Foreign(Flat):
    def nearest(self, queries, k, within=math.inf):
        return super().nearest(queries, k, within) + 1000


class Few(Flat):
    def nearest(self, queries, k, within=math.inf):
        return super().nearest(queries, k - 3, within)


class Unordered(Flat):
    def nearest(self, queries, k, within=math.inf):
        return super().nearest(queries, k, within)[:, ::-1]


@pytest.mark.parametrize(
    ("index", "fault"),
    [
        (Foreign, "do not exist"),
        (Few, "which are fewer than the 10 asked for"),
        (Unordered, "the nearest must come first"),
    ],
)
def test_a_memory_that_answers_wrongly_is_refused_by_name_before_the_first_movement(index, fault):
    kind = type("Mine", (Memory,), {"index": lambda self, keys: index(keys)})
    with pytest.raises(ValueError, match=f"memory Mine: .*{fault}"):
        practice(ARM, 0, memory=kind)


def test_what_is_no_memory_and_one_of_another_robot_are_refused():
    with pytest.raises(ValueError, match="must derive from Memory, got a dict"):
        practice(ARM, 0, memory=lambda *dims: {})
    with pytest.raises(ValueError, match=r"must have dims \(0, 3, 2\) of context, theta, outcome, got \(0, 7, 2\)"):
        practice(ARM, 0, memory=Memory(0, 7, 2))


def test_more_than_faiss_can_hold_is_told_in_one_line(monkeypatch):
    def full(self, rows):
        raise MemoryError("std::bad_alloc")

    monkeypatch.setattr(faiss.IndexFlatL2, "add", full)
    with pytest.raises(ValueError, match="faiss cannot index 5 rows of 2 numbers: std::bad_alloc"):
        Flat(Growing(2, np.zeros((5, 2)))).nearest(np.zeros((1, 2)), 1)


@pytest.mark.parametrize("name", SEARCHING)
def test_faiss_is_searched_in_the_life_of_each_learner_with_an_inverse_model(name, tmp_path, monkeypatch):
    searched, search = [], faiss.IndexFlatL2.search
    monkeypatch.setattr(faiss.IndexFlatL2, "search", lambda self, *given: searched.append(self) or search(self, *given))
    settings = {"environment": "planar-arm-7", "evaluate_at": (), "repeats": 0, "out": tmp_path}
    parts = build(Config.from_settings({**settings, "algorithm": name, "movements": 200 if "taught" in name else 60}))
    with RunLoop(parts, resume=False) as life:
        for _ in life.episodes():
            pass
    assert len(searched) >= 30  # the first movements, and those that repeat a demonstration, have no goal
