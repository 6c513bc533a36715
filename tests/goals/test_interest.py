"""Goal interest mapping and deciding a goal: eq. (4), the recursive split, the three goal modes."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from sgimd_torch.goals.interest_map import InterestMap
from sgimd_torch.goals.regions import absolute_progress, gained_progress
from sgimd_torch.spaces import Array, Box, stream
from worlds import NO_CONTEXT, problem

LINE, SQUARE = Box.cube(0, 1, 1), Box.cube(0, 1, 2)
BY_EQ_3 = {"g_max": 50, "max_aspect": np.inf, "progress": absolute_progress}


def chi_square(counts: ArrayLike, probabilities: ArrayLike) -> float:
    counts = np.asarray(counts)
    expected = counts.sum() * np.asarray(probabilities)
    return float(np.sum((counts - expected) ** 2 / expected))


MAP = partial(InterestMap, **BY_EQ_3)


def four_regions_of_interest_1_2_3_4(**options):
    """The line, cut into quarters of interests .1, .2, .3 and .4: eq. (4) makes of them 0, 1/6, 2/6 and 3/6."""
    goals = MAP(problem(outcomes=LINE, seed=1), window=4, **options)
    for index in range(112):
        goals.add(NO_CONTEXT, [(index * 0.6180339887) % 1], -1)  # the golden ratio spreads evenly: quarters
    assert len(goals.regions) == 4
    for index, region in enumerate(goals.regions):
        for competence in (-1, -1, -0.8 + 0.2 * index, -0.8 + 0.2 * index):
            goals.add(NO_CONTEXT, (region.low + region.high) / 2, competence)
    assert [region.interest() for region in goals.regions] == pytest.approx([0.1, 0.2, 0.3, 0.4])
    return goals


def counts_in(regions: list, samples: Array) -> Array:
    return np.histogram(samples[:, 0], [region.low[0] for region in regions] + [1.0])[0]


def test_the_three_modes_share_the_goals_7_to_2_to_1_and_the_first_and_last_follow_interest_above_the_least():
    goals = four_regions_of_interest_1_2_3_4(near=0.01)
    samples = np.array([goals.sample(NO_CONTEXT) for _ in range(10_000)])
    counts = counts_in(goals.regions, samples)
    volumes = np.array([region.high[0] - region.low[0] for region in goals.regions])
    expected = 0.8 * np.array([0, 1, 2, 3]) / 6 + 0.2 * volumes  # modes 1 and 3 follow interest, mode 2 does not
    assert chi_square(counts, expected) < 16.3  # 3 degrees of freedom: odds 1 in 1000
    last = goals.regions[-1]
    worst = last.goals[last.competences == -1]
    is_near = np.abs(samples - worst[:, 0]).min(axis=1) <= 0.01 * (last.high[0] - last.low[0])
    in_last = samples[:, 0] >= last.low[0]
    # Mode 3 alone would give .1 * 3/6; other modes come near too, in as large a part as lies near a worst goal.
    line = np.linspace(last.low[0], last.high[0], 100_001)
    share = np.mean(np.abs(line[:, None] - worst[:, 0]).min(axis=1) <= 0.01 * (last.high[0] - last.low[0]))
    mode_3, others = 0.1 * 3 / 6, 0.7 * 3 / 6 + 0.2 * volumes[-1]
    probability = (mode_3 + others * share) / (mode_3 + others)
    assert chi_square(np.bincount(is_near[in_last], minlength=2), [1 - probability, probability]) < 10.8  # 1 in 1000


def test_each_mode_alone_draws_its_own_goals():
    first, anywhere, worst = (
        np.array([goals.sample(NO_CONTEXT)[0] for _ in range(200)])
        for goals in (four_regions_of_interest_1_2_3_4(modes=modes, near=0.01) for modes in np.eye(3).tolist())
    )
    regions = four_regions_of_interest_1_2_3_4().regions
    least, last = regions[0].high[0], regions[-1]
    assert min(first.min(), worst.min()) >= least  # eq. (4): the region of least interest is never chosen
    assert (anywhere < least).sum() > 20  # a quarter of T; 50 expected, five standard deviations above 20
    near = np.abs(worst[worst >= last.low[0], None] - last.goals[last.competences == -1][:, 0]).min(axis=1)
    assert near.max() <= 0.01 * (last.high[0] - last.low[0])


def test_goals_are_uniform_in_every_context_while_all_interests_are_equal():
    goals = InterestMap(problem(contexts=LINE, outcomes=LINE, seed=3), near=1.0)  # a whole region is near its worst
    for context, goal in stream(3, "planted").uniform(size=(400, 2)) ** [2, 3]:
        goals.add([context], [goal], -1)
    assert len({region.high[0] - region.low[0] for region in goals.regions}) > 2
    for context in (0.0, 0.1, 1.0):
        counts = np.histogram([goals.sample([context]) for _ in range(3000)], 10, (0, 1))[0]
        assert chi_square(counts, np.full(10, 0.1)) < 27.9  # 9 degrees of freedom: odds 1 in 1000, three times


def test_only_regions_that_contain_the_context_are_chosen():
    goals = InterestMap(problem(contexts=LINE, outcomes=LINE, seed=5), **BY_EQ_3)
    rng, n_late = stream(5, "planted"), 0
    for _ in range(600):  # progress only in the upper half of contexts, and there for lower goals
        context, goal = rng.uniform(size=2)
        improves = context > 0.5 and goal < 0.5
        n_late += improves
        goals.add([context], [goal], -1 + n_late / 200 if improves else -1)
    upper = np.array([goals.sample([0.9]) for _ in range(500)])
    lower = np.array([goals.sample([0.1]) for _ in range(500)])
    assert np.mean(upper < 0.55) > 0.85  # mode 2 leaves .2 * .55 + .8 = .91, less six standard errors
    assert 0.35 < np.mean(lower < 0.5) < 0.65  # no progress in this context: uniform, six standard errors


def test_mode_3_stays_near_the_least_competent_goal_in_the_unit_of_each_dimension():
    goals = InterestMap(problem(outcomes=Box(np.zeros(2), np.array([1.0, 100.0])), seed=6))
    for goal, competence in (([0.2, 20], -0.1), ([0.5, 50], -0.9), ([0.8, 80], -0.2)):
        goals.add(NO_CONTEXT, goal, competence)
    away = np.abs(np.array([goals.sample(NO_CONTEXT) for _ in range(10_000)]) - [0.5, 50]) / [1, 100]
    rings = np.histogram(away.max(axis=1), [0, 0.025, 0.05, 0.075, 0.5])[0]
    # Squares around the goal: a tenth of all goals in the second, a quarter of these in the first; others anywhere.
    sides = np.diff(np.square([0, 0.05, 0.1, 0.15, 1]))
    assert chi_square(rings, 0.9 * sides + 0.1 * np.array([0.25, 0.75, 0, 0])) < 16.3  # 3 degrees: 1 in 1000


def test_mode_3_does_not_cross_a_cut():
    goals = InterestMap(problem(outcomes=LINE, seed=7), **BY_EQ_3)
    for index in range(51):
        goals.add(NO_CONTEXT, [index / 50], -0.5)
    _, above = goals.regions
    goals.add(NO_CONTEXT, above.low, -1)  # the only progress, so this region is chosen, and its worst goal
    samples = np.array([goals.sample(NO_CONTEXT) for _ in range(10_000)])
    below, cut, near = samples < above.low, above.low[0], 0.05 * (1 - above.low[0])
    assert np.mean(below) == pytest.approx(0.2 * cut, abs=5 * 0.003)  # mode 2 alone; five standard errors
    of_its_own = 0.1 + 0.7 * 0.05 + 0.2 * near  # all of mode 3 within its reach
    assert np.mean(~below & (samples <= cut + near)) == pytest.approx(of_its_own, abs=5 * 0.0034)


def test_mode_3_tries_all_goals_that_are_equally_bad():
    goals = InterestMap(problem(outcomes=LINE, seed=8), near=0.01)
    for goal, competence in ((0.2, -1), (0.5, -0.5), (0.8, -1)):
        goals.add(NO_CONTEXT, [goal], competence)
    samples = np.array([goals.sample(NO_CONTEXT) for _ in range(5000)])
    near = [np.mean(np.abs(samples - place) <= 0.01) for place in (0.2, 0.5, 0.8)]
    # Half of mode 3 near each of the two, and the others anywhere: .05 + .9 * .02; six standard errors.
    assert near == pytest.approx([0.068, 0.018, 0.068], abs=6 * 0.0036)


def test_a_region_is_cut_when_it_holds_more_goals_than_allowed_and_not_before():
    goals = InterestMap(problem(outcomes=LINE, seed=9), g_max=40)
    for index in range(40):
        goals.add(NO_CONTEXT, [index / 40], -1)
    assert [region.path for region in goals.regions] == ["R"]
    goals.add(NO_CONTEXT, [1.0], -1)
    assert [region.path for region in goals.regions] == ["R0", "R1"]


def cut_of(points: Array, competences: Array, gains: Array | None = None, **options) -> tuple[int, float]:
    """(axis, position) of the first cut of the square, which is made at the 51st goal."""
    goals = InterestMap(problem(outcomes=SQUARE, seed=11), **{**BY_EQ_3, **options})
    for point, competence, gain in zip(points, competences, np.zeros(51) if gains is None else gains, strict=True):
        goals.add(NO_CONTEXT, point, competence, gain=gain)
    below, _ = goals.regions
    axis = int(np.argmin(below.high))
    return axis, float(below.high[axis])


def evenly_spaced(axis: int) -> tuple[Array, Array]:
    """51 goals at 0, 1/50 ... 1 on an axis, scattered on the other, and an order of time scattered on both."""
    places = np.empty((51, 2))
    places[:, axis] = np.arange(51) * 20 % 51 / 50  # 20 and 51 have no common factor: each place once
    places[:, 1 - axis] = np.arange(51) * 7 % 51 / 50
    return places, places[:, axis]


@pytest.mark.parametrize("axis", [0, 1])
def test_a_region_is_cut_where_progress_ends(axis):
    points, along = evenly_spaced(axis)
    competences = np.where((along < 0.39) & (np.arange(51) >= 26), 0.0, -1.0)
    assert cut_of(points, competences) == (axis, pytest.approx(8 / 21))  # the candidate between places .38 and .40
    competences, gains = -stream(11, "planted").uniform(size=51), np.where(along < 0.39, 0.2, 0.0)
    # 20 * 31 * .2 = 124; a place lower 17 * 34 * .19, higher 22 * 29 * .18
    assert cut_of(points, competences, gains, progress=gained_progress) == (axis, pytest.approx(8 / 21))


def test_a_small_part_of_great_progress_does_not_outweigh_a_balanced_cut():
    points, along = evenly_spaced(0)
    early = np.arange(51) < 26
    competences = np.full(51, -1.0)
    competences[(along < 0.49) & ~early] = -0.6  # interest .2 in 25 goals, .5 in the first 5
    competences[(along < 0.09) & ~early] = 0.0
    axis, cut = cut_of(points, competences)
    assert axis == 0
    assert 0.3 < cut < 0.6
    # The paper's rule: the greatest difference of interests, .5 - .2 and less elsewhere, below the fifth place.
    assert cut_of(points, competences, balanced=False) == (0, pytest.approx(2 / 21))


def test_without_any_difference_a_region_is_halved_across_its_longest_side():
    goals = InterestMap(problem(outcomes=Box(np.zeros(2), np.array([1.0, 1000.0])), seed=12), **BY_EQ_3)
    for point in stream(12, "planted").uniform([0, 0], [1, 1000], size=(60 * 16, 2)):
        goals.add(NO_CONTEXT, point, -1)
    sides = np.array([(region.high - region.low) / [1, 1000] for region in goals.regions])
    aspect = sides.max(axis=1) / sides.min(axis=1)
    assert len(sides) > 20
    assert aspect.max() < 5  # halves of halves: 1 or 2, times the luck of the median; strips would reach 2^16


def test_where_no_cut_is_valid_the_oldest_quarter_is_forgotten():
    goals = InterestMap(problem(outcomes=LINE, seed=13), g_max=50)
    competences = -np.arange(51) / 51
    for competence in competences:
        goals.add(NO_CONTEXT, [0.3], competence, gain=-competence)
    (region,) = goals.regions
    assert region.competences.tolist() == competences[12:].tolist()  # 51 // 4 = 12
    assert region.gains.tolist() == (-competences[12:]).tolist()
    goals.add(NO_CONTEXT, [0.3], -1)
    assert len(goals.regions[0].goals) == 40
    assert goals.regions[0].attempts == 52


def test_a_cut_leaves_a_twentieth_of_g_max_on_both_sides():
    for n_right, n_goals in ((2, [39]), (3, [48, 3])):  # 2 < 50 / 20 <= 3; 39 are left of 51 when none is cut
        goals = InterestMap(problem(outcomes=LINE, seed=14), g_max=50, cuts=50)  # a cut between any two goals
        for goal in [0.2] * (51 - n_right) + [0.8] * n_right:
            goals.add(NO_CONTEXT, [goal], -1)
        assert [len(region.goals) for region in goals.regions] == n_goals


COORDINATE = st.one_of(st.sampled_from([-1.0, -0.5, 0.0, 0.5, 1.0]), st.floats(-1, 1))
POINTS = st.lists(st.tuples(COORDINATE, COORDINATE, COORDINATE), min_size=30, max_size=120)


@given(points=POINTS, seed=st.integers(0, 99), max_aspect=st.sampled_from([np.inf, 2.0]), cuts=st.sampled_from([3, 20]))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_leaves_tile_the_box_and_keep_each_goal_once_in_order_whatever_is_added(points, seed, max_aspect, cuts):
    box, points = Box.cube(-1, 1, 3), np.array(points)
    contexts, outcomes = Box.cube(-1, 1, 1), Box.cube(-1, 1, 2)
    options = {"max_aspect": max_aspect, "cuts": cuts}  # few cuts fall on goals, many between them
    goals = InterestMap(problem(contexts=contexts, outcomes=outcomes, seed=seed), g_max=8, window=4, **options)
    competences = -np.arange(len(points)) / len(points)  # tells when a goal was added
    kept, after = 0, goals.regions
    for point, competence in zip(points, competences, strict=True):
        before = {region.path: region for region in after}
        goals.add(point[:1], point[1:], competence, gain=-competence)
        after = goals.regions
        new = [region for region in after if region.path not in before]
        assert sum(competence in region.competences for region in after) == 1
        assert len(new) in (0, 2)
        kept += 1
        if sum(len(region.goals) for region in after) != kept:
            kept -= 9 // 4  # the documented forgetting: no valid cut, a quarter of g_max + 1
            assert not new
        assert sum(len(region.goals) for region in after) == kept
        for region in after:
            assert len(region.goals) <= 8
            places = np.hstack((region.contexts, region.goals))
            assert (np.diff(region.competences) < 0).all()
            assert np.array_equal(places, points[np.rint(-len(points) * region.competences).astype(int)])
            assert region.gains.tolist() == (-region.competences).tolist()
            is_below = (places < region.high) | ((places == region.high) & (region.high == box.high))
            assert ((region.low <= places) & is_below).all()
        for region in new:
            parent = before[region.path[:-1]]
            assert region.attempts == len(region.goals)
            assert (region.high - region.low >= (parent.high - parent.low) / 15 * (1 - 1e-9)).all()  # rounding
    lows, highs = (np.array([getattr(region, name) for region in after]) for name in ("low", "high"))
    assert np.prod(highs - lows, axis=1).sum() == pytest.approx(8)
    overlap = np.minimum(highs[:, None], highs) - np.maximum(lows[:, None], lows)
    assert ((overlap > 0).all(axis=2) == np.eye(len(after), dtype=bool)).all()
    assert [region.path for region in after] == sorted(region.path for region in after)


def test_sides_are_not_cut_much_shorter_than_others_beyond_the_largest_aspect():
    goals = InterestMap(problem(outcomes=SQUARE, seed=16), **{**BY_EQ_3, "max_aspect": 2})
    rng = stream(16, "planted")
    for x, y in rng.uniform(size=(600, 2)):
        goals.add(NO_CONTEXT, [x, y], -1 + x * rng.uniform())
    sides = np.array([region.high - region.low for region in goals.regions])
    # A side at most twice shorter than the other may be cut once more, to no less than a fifteenth.
    assert (sides.max(axis=1) / sides.min(axis=1)).max() <= 2 * 15


def test_a_context_that_never_changes_is_never_cut():
    goals = InterestMap(problem(contexts=LINE, outcomes=LINE, seed=17), **{**BY_EQ_3, "max_aspect": 2})
    for goal in stream(17, "planted").uniform(size=400):
        goals.add([0.3], [goal], -goal)
    assert len(goals.regions) > 8
    assert all(region.low[0] == 0 and region.high[0] == 1 for region in goals.regions)
