"""Made-up rows of tables on robots."""

from itertools import product

import numpy as np

from table import TABLES, merge


def write_lives(folder, factor=lambda *key: 1.0, robots=60, seeds=8):
    """Tables in which every claim is true; ``factor`` (columns of the key) -> factor of an error.

    Each change is noticed; ``factor`` (robot, change, "noticed", movements) is the number of changes noticed.
    Two model files: `practice` errs .8 times as much as random movements on one, the other is refused.
    """
    from changing import AFTER, ARM, BEGUN, CHANGES, ROBOTS, SIMULATOR, after, learners
    from random_robots import COUNTS, LEARNERS, RANDOM, SEEDS, TABLE

    rows = []
    for number in range(robots):
        for name in LEARNERS:
            for seed, at in product(SEEDS[name], COUNTS):
                error = {"practice": 0.25, RANDOM: 1.0}.get(name, 0.8) * (1 + 0.002 * number) * (1 + 0.001 * (seed % 5))
                rows.append((number, name, seed, at, error * factor(number, name, at), 0))
    merge(folder, TABLE, [dict(zip(TABLES[TABLE][1], row, strict=False)) for row in rows])
    rows, goes_on = [], {**dict.fromkeys(AFTER, 0.4), 50: 0.4}
    places = [(robot, change, after(robot)) for robot in ROBOTS for change in CHANGES]
    for robot, change, times in [*places, (ARM, SIMULATOR, BEGUN)]:
        for learner in learners(change):
            for at in times:
                for seed in range(seeds):
                    error = {"goes-on": goes_on[at], "wrong": 0.9}.get(learner, 1.0) * np.exp(0.01 * (seed % 3))
                    noticed = int(factor(robot, change, "noticed", at))
                    rows.append((robot, change, learner, seed, at, error * factor(robot, change, learner, at), noticed))
    merge(folder, "changes.csv", [dict(zip(TABLES["changes.csv"][1], row, strict=False)) for row in rows])
    rows = [
        ("dm_control/arm.xml", "site:tip", "", "1.0", "right", "", 0.4, 0.5, 0.8, 0.7, 0.9),
        ("robosuite/arm.xml", "geom:x", "", "1.5", "refused", "no", *[None] * 5),
    ]
    merge(folder, "model_files.csv", [dict(zip(TABLES["model_files.csv"][1], row, strict=True)) for row in rows])
    return folder
