"""Lives of the learners and with the teachers that rooms bring, as in tests/learner/test_life.py."""

import numpy as np
import pytest
from hypothesis.stateful import rule

from any_life import ARM, LESSONS, NUMBERS, QUIET, WATCHES, Lives, check_lives, check_start, exemplars
from sgimd_torch import session
from sgimd_torch.algorithms.paper import observation, sagg_riac, sgim_d
from sgimd_torch.extras.asking.algorithms import SEARCHING, sgim_acts
from sgimd_torch.extras.asking.teachers import AnsweringTeacher
from sgimd_torch.extras.rivals.alp_gmm import AlpGmm
from sgimd_torch.extras.rivals.cma_es import CmaEs
from sgimd_torch.extras.rivals.quality_diversity import cma_me_alone, map_elites_alone
from sgimd_torch.extras.teach.by_hand import ByHand
from sgimd_torch.record.replay import load_life, save_life
from sgimd_torch.session import run
from sgimd_torch.spaces import stream
from sgimd_torch.teachers import PeriodicTeacher


def asked():
    return {"ann": AnsweringTeacher(LESSONS[:2], stream(0, "ann"), takes=1)}


class LivesByHand(Lives):
    """The teacher of the run is a hand, which may give a lesson at any time."""

    @rule(k=NUMBERS)
    def give(self, k):
        self.both(lambda learner, teacher: teacher.give(LESSONS[k]))

    @rule()
    def load(self):
        super().load()
        if self.teacher._given:  # no record has what was given and not offered
            self.twins_teacher.give(self.teacher._given)


def test_a_learner_that_asks_and_repeats_its_life_is_the_same(monkeypatch):
    monkeypatch.setattr(session, "JOINS_EVERY", 1)
    check_lives(lambda: Lives(lambda: sgim_acts(ARM, 0, teachers=asked(), **WATCHES, **SEARCHING), asked=asked()))


@pytest.mark.parametrize("learner", [sgim_d, observation])
def test_a_learner_that_is_taught_by_hand_and_repeats_its_life_is_the_same(learner, monkeypatch):
    def hand():
        return ByHand(teacher=PeriodicTeacher(LESSONS, stream(0, "teacher"), every=3))

    monkeypatch.setattr(session, "JOINS_EVERY", 1)
    check_lives(lambda: LivesByHand(lambda: learner(ARM, 0, **WATCHES), hand))


RIVALS = {
    "map-elites": lambda: map_elites_alone(QUIET, 0, first=20),
    "cma-me": lambda: cma_me_alone(QUIET, 0),
    "alp-gmm and cma-es": lambda: sagg_riac(QUIET, 0, goals=AlpGmm, search=CmaEs),
}


def line(episode):
    return episode.index, episode.move and (episode.move.theta.tobytes(), episode.move.origin)


@pytest.mark.parametrize("name", RIVALS)
def test_a_rival_goes_on_in_the_middle_of_its_search(name, tmp_path):
    lines, whole = [], RIVALS[name]()
    for episode in run(whole, QUIET, 1, movements=130):
        lines.append(line(episode))
        if episode.index == 76:
            save_life(whole, tmp_path / "life.sqlite")
    learner = RIVALS[name]()
    load_life(learner, tmp_path / "life.sqlite")
    assert [line(episode) for episode in run(learner, QUIET, 1, movements=130)] == lines[77:]


@pytest.mark.parametrize("build", [map_elites_alone, cma_me_alone])
def test_a_learner_starts_from_a_memory_and_leaves_it_as_it_was_and_so_does_the_one_that_loads(build, tmp_path):
    check_start(build, tmp_path / "life.sqlite")


def test_map_elites_from_a_memory_varies_its_elites_at_once():
    start = exemplars(40)
    moves = [e.move.theta for e in run(map_elites_alone(QUIET, 0, memory=start, sd=0.01), QUIET, 0, movements=10)]
    assert max(np.abs(start.thetas - theta).max(axis=1).min() for theta in moves) < 0.06
