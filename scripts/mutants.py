"""Put small faults into a copy of the library, one at a time, and see whether the tests find them.

A mutant is the library with one fault: a sign, a factor, a bound, an order. A mutant dies if one of its tests fails;
if all pass, it survives, and a test is missing. Each mutant is tried with the test files that ought to find it, without
the tests marked slow; at the end, the tests that failed are carried out without a mutant. The working tree does not
change. All mutants take about 10 minutes of processor time.

    python scripts/mutants.py                        # all mutants; with --list, only their numbers and names
    python scripts/mutants.py 7 12 simplex           # numbers 7 and 12, and all whose names contain "simplex"
    python scripts/mutants.py --commit HEAD~3        # the code of a commit, in place of the working tree
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from tqdm import tqdm

HERE: Final = Path(__file__).resolve().parents[1]
LONGEST: Final = 900  # time (s) after which the tests of a mutant are ended; an endless loop counts as a fault found

# Two lines for each mutant: name | file below sgimd_torch/ | files below tests/; then: text ==> text in its place.
MUTANTS: Final = r"""
eq. (2): the ninth of the nearest outcomes counts | competence.py | test_competence.py
    near_outcomes(context, goal, 1)] ==> near_outcomes(context, goal, 9)[-1:]]
competence of an attempt by its worst outcome | competence.py | test_competence.py
    float(np.max(performance( ==> float(np.min(performance(
eq. (3): progress is twice as large | goals/regions.py | goals/test_regions.py
    / (2 * half)) ==> / half)
interest by the oldest goals of a region | goals/regions.py | goals/test_regions.py
    competences[-window:] ==> competences[:window]
eq. (4): the least interest is not subtracted | goals/regions.py | goals/test_interest.py
    interests - interests.min() ==> interests
modes 1 and 2 have each other's probability | goals/interest_map.py | goals/test_interest.py
    (0.7, 0.2, 0.1) ==> (0.2, 0.7, 0.1)
split one goal too early | goals/interest_map.py | goals/test_interest.py
    <= self.g_max: ==> < self.g_max:
split into regions however thin | goals/interest_map.py | goals/test_interest.py
    < _MIN_SIDE * side ==> < 0 * side
eq. (5): the printed sign of the exponent | environments/motor_primitives.py | environments/test_motor_primitives.py
    np.exp(-self.sharpness ==> np.exp(self.sharpness
eq. (6): knots out of their range | environments/motor_primitives.py | environments/test_motor_primitives.py
    bounds=(0.0, 1.0) ==> bounds=(-1.0, 2.0)
eq. (7): performance below -1 | competence.py | test_competence.py
    -np.minimum(1.0, _distance( ==> -np.minimum(9.0, _distance(
eq. (8): unsteady neighbourhoods are preferred | inverses/local.py | inverses/test_inverse_model.py
    + self.alpha * spreads ==> - self.alpha * spreads
eq. (8): one neighbourhood too few is compared | inverses/local.py | inverses/test_inverse_model.py
    context, goal, self.h_max) ==> context, goal, self.h_max - 1)
eq. (9): a narrower Gaussian | inverses/local.py | inverses/test_inverse_model.py
    np.exp(0.5 * ( ==> np.exp(1.0 * (
eq. (10): root mean square in place of the mean | evaluation.py | test_evaluation.py
    float(self.errors.mean()) ==> float((self.errors**2).mean() ** 0.5)
what an evaluation tries is remembered | evaluation.py | learner/test_session.py
    failed = np.isnan( ==> failed = inverse.problem.memory.extend(contexts, thetas, outcomes) or np.isnan(
a failed answer counts as no error | evaluation.py | learner/test_failures.py
    np.where(np.isnan(outcomes), environment.rest, outcomes) ==> np.where(np.isnan(outcomes), goals, outcomes)
simplex: reflection too short | searches/simplex.py | searches/test_search.py
    beyond(centre, 1) ==> beyond(centre, 0.9)
simplex: it shrinks away from the best vertex | searches/simplex.py | searches/test_search.py
    vertices[0] + 0.5 * (vertices[j] - vertices[0]) ==> vertices[0] - 0.5 * (vertices[j] - vertices[0])
simplex: movements outside of Pi | searches/simplex.py | searches/test_search.py
    policies.clip(self.rng.normal(theta, noise * policies.sides) if noise ==> (theta + 9 if noise
gradient search: errors at anchors are added | forward_model/anchored.py | forward_model/test_anchored.py
    return landing + correction, ==> return landing - correction,
gradient search: Adam's second moment is too short | forward_model/anchored.py | forward_model/test_anchored.py
    square.lerp(gradient**2, 0.001) ==> square.lerp(gradient**2, 0.1)
gradient search: Adam's second moment is not corrected | forward_model/anchored.py | forward_model/test_anchored.py
    (square / (1 - 0.999**i)) ==> (1000 * square)
gradient search: no penalty of the variance | forward_model/anchored.py | forward_model/test_anchored.py
    ((landing - goals) ** 2).sum(dim=-1) + variance ==> ((landing - goals) ** 2).sum(dim=-1) + 0 * variance
training: noise weighs twice in the loss | forward_model/networks.py | forward_model/test_networks.py
    0.5 * (log_variance + ==> 0.5 * (2 * log_variance +
training on held-out exemplars | forward_model/training.py | forward_model/test_forward_model.py
    torch.nonzero(~is_held)[:, 0] ==> torch.arange(len(x))
training: weights after a divergence are kept | forward_model/training.py | forward_model/test_forward_model.py
    self.model.load_state_dict(weights) ==> weights.clear()
board: counts in place of shares | board/curves.py | board/test_board.py
    {tag: n / total ==> {tag: n / 1
board: a curve has its points one movement late | board/listener.py | board/test_board.py
    self._movements % EVERY == 0 ==> self._movements % EVERY == 1
board: goals met within a whole tile | board/listener.py | board/test_board.py
    self._benchmark.side / 2) ==> self._benchmark.side)
index: contexts do not count | memory/__init__.py | memory/test_memory.py
    np.concatenate((contexts, outcomes), axis=1) ==> np.concatenate((0 * contexts, outcomes), axis=1)
index: of equally near exemplars the newest first | memory/ordered.py | memory/test_memory.py
    (distance, row) < (squared ==> (distance, -row) < (squared
index: the radius is not squared | memory/neighbours.py | memory/test_memory.py
    k, within * within) ==> k, within)
index: rows hidden by rounding are not looked for | memory/ordered.py | memory/test_neighbours.py
    if singles[q, -1] < 0 or others < ==> if singles[q, -1] < 0 or -others > 1 +
index: the newest rows are missing beside a graph | memory/neighbours.py | memory/test_neighbours.py
    np.where(newest < 0, -1, newest + first) ==> np.where(newest < 0, -1, newest)
gross errors: precisions keep what they were | inverses/kernels.py | inverses/test_local_process.py
    precision[j] -= shrinking * column[j] ** 2 ==> precision[j] -= 0 * column[j]
a Gaussian process with another kernel | inverses/kernels.py | inverses/test_local_process.py
    covariance[j], slope[j] = near**3, ==> covariance[j], slope[j] = near**2,
requests: a teacher without a reply costs nothing | extras/asking/strategy.py | extras/asking/test_asking.py
    strategy=strategy, gain=-1.0) ==> strategy=strategy, gain=0.0)
requests: costs do not count | extras/asking/interest.py | extras/asking/test_interest.py
    - np.log(cost) ==> - 0 * np.log(cost)
record: the outcome in the columns of the goal | record/layout.py | record/test_record.py
    *_cells(event.goal, t), ==> *_cells(event.outcome, t),
record: NaN is kept as a number | record/layout.py | record/test_record.py
    (None if value != value else ==> (value if value != value else
record: the last rows come first | record/__init__.py | record/test_record.py
    ORDER BY rowid LIMIT ==> ORDER BY -rowid LIMIT
replay: another theta is accepted | record/replay.py | learner/test_life.py
    and not box.same(recorded, now): ==> and now is recorded:
replay: another demonstration is accepted | record/replay.py | learner/test_life.py
    np.allclose(was, now, ROUNDING, ROUNDING) for ==> (was.shape == now.shape) for
random streams: of a name only the first letter counts | spaces.py | test_spaces.py
    *name.encode() ==> *name[:1].encode()
failures: a failed movement does not count | learner/__init__.py | learner/test_failures.py
    self.movements += 1 ==> self.movements += not isinstance(outcome, Failure)
at once: attempts are replayed out of order | learner/__init__.py | learner/test_at_once.py
    return [] if in_order else ==> return [] if reported else
"""


def mutants() -> dict[int, list[str]]:
    """Name, file, tests, right text and wrong text of each mutant, by number."""
    lines = MUTANTS.strip().splitlines()
    pairs = zip(lines[::2], lines[1::2], strict=True)
    return {n: [*head.split(" | "), *change.strip().split(" ==> ")] for n, (head, change) in enumerate(pairs, start=1)}


def meant(word: str, every: dict[int, list[str]]) -> list[int]:
    """Numbers of the mutants that a word means, a number or a part of names."""
    return [n for n, (name, *_) in every.items() if (word == str(n) if word.isdecimal() else word in name)]


def copy_to(folder: Path, commit: str | None) -> bool:
    """Copy the files of a commit to ``folder``, or those of the working tree that git tracks; False: no such commit."""
    git = ["git", "-C", str(HERE)]
    if commit is None:  # "stash create" makes a commit of the working tree that no branch has; nothing without a change
        commit = subprocess.run([*git, "stash", "create"], capture_output=True, text=True).stdout.strip() or "HEAD"
    packed = subprocess.run([*git, "archive", commit], stdout=subprocess.PIPE)
    return not packed.returncode and not subprocess.run(["tar", "-xC", str(folder)], input=packed.stdout).returncode


def failing(folder: Path, tests: list[str], compiled: str) -> str | None:
    """The first test that fails, as a word for pytest; "" if all pass; None if they cannot be carried out.

    ``compiled`` is the name of numba's folder, a new one for a mutant of compiled code: numba would not see the change.
    """
    words = [sys.executable, "-m", "pytest", "-x", "-m", "not slow", "--tb=no", "-rfE", "-p", "no:cacheprovider"]
    variables = {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1", "NUMBA_CACHE_DIR": str(folder / compiled)}
    environment = {**os.environ, **variables}
    try:
        done = subprocess.run([*words, *tests], cwd=folder, env=environment, capture_output=True, timeout=LONGEST)
    except subprocess.TimeoutExpired:
        return tests[0]
    failed = re.search(r"^(?:FAILED|ERROR) ([^\s\[]+)", done.stdout.decode(errors="replace"), re.MULTILINE)
    return {0: "", 1: failed and failed[1]}.get(done.returncode)


def found_by(folder: Path, number: int, file: str, tests: str, right: str, wrong: str) -> str | None:
    """The test that finds a mutant; "" if it survives; None if it cannot be tried."""
    path = folder / "sgimd_torch" / file
    source = path.read_text(encoding="utf-8") if path.exists() else ""
    if source.count(right) != 1:
        return None
    path.write_text(source.replace(right, wrong), encoding="utf-8")
    paths = [f"tests/{test}" for test in tests.split()]
    test = failing(folder, paths, f"compiled-{number}" if "numba" in source else "compiled")
    path.write_text(source, encoding="utf-8")
    return test


def main() -> int:
    """Try the mutants, and return 1 if one survives or no longer applies."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("which", nargs="*", metavar="MUTANT", help="number, or part of a name (default: all)")
    parser.add_argument("--commit", help="commit whose code and tests are tried (default: the working tree)")
    parser.add_argument("--list", action="store_true", help="print the mutants, and end")
    options, every = parser.parse_args(), mutants()
    wanted = [number for word in options.which or [""] for number in meant(word, every) or [word]]
    for word in (word for word in wanted if word not in every):
        parser.error(f"{word} is no number from 1 to {len(every)} and in no name; --list prints numbers and names")
    if options.list:
        print(*(f"{number:3} {every[number][0]} ({every[number][1]})" for number in wanted), sep="\n")
        return 0
    with TemporaryDirectory() as place:
        folder = Path(place)
        if not copy_to(folder, options.commit):
            parser.error(f"--commit must be a commit of this repository, got {options.commit}")
        results = dict[int, str | None]()
        for number in tqdm(wanted, disable=None):
            name, *rest = every[number]
            results[number] = test = found_by(folder, number, *rest)
            fate = "cannot be tried" if test is None else f"died: {test}" if test else "SURVIVED"
            tqdm.write(f"{number:3} {name:56} {fate}")
        killers = sorted({test for test in results.values() if test})
        wrong = failing(folder, killers, "compiled") if killers else ""
    print(f"{len(killers)} tests have found {sum(map(bool, results.values()))} of {len(results)} mutants")
    if wrong != "":
        print(f"but without any mutant a test fails, too: {wrong}")
    return int(wrong != "" or not all(results.values()))


if __name__ == "__main__":
    sys.exit(main())
