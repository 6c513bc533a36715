"""Mutants: does a test notice when one place of the library is changed?

    scripts/mutants.py reach                          # once: which of the fast tests reach which line
    scripts/mutants.py judge --seed 1 --count 100     # a row for each mutant in runs/mutants-1.csv
    scripts/mutants.py judge --seed 1 --only 3 14     # some of them again, with other tests
    scripts/mutants.py judge --seed 1 --of 1a2b3c4    # the lot of an earlier commit, with today's code and tests

It needs ``pip install cosmic-ray==8.7.0 pytest-cov==7.1.0`` and a copy of the repository to work in: it changes files
of ``sgimd_torch/`` while it runs. A lot draws a place, then one of the mutations that Cosmic Ray has for it. The first
test that fails kills the mutant. Asked are the tests that reach its lines, those first that reach the fewest lines in
all; for lines that run on import, tests/test_defaults.py and the tests that reach anything in their file. An exit code
below 0 is a crash, which may have other causes: judge again. docs/robustness.md has the counts.
"""

from __future__ import annotations

import argparse
import ast
import csv
import json
import os
import random
import re
import signal
import subprocess
import sys
from collections import Counter, defaultdict
from difflib import SequenceMatcher
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names
from coverage import CoverageData

ROOT = Path(__file__).resolve().parent.parent
WORK = ROOT / "runs"
TESTS = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", "not slow"]
COVERAGE = """[run]
source = {0}/sgimd_torch
data_file = {0}/runs/coverage
parallel = true
concurrency = multiprocessing, thread
context = ${{PYTEST_CURRENT_TEST-}}
"""
# Not those that always raise (a shift of floats, < for is) or change no behaviour (is for ==).
SUMS, BITS = "(Add|Sub|Mul|Div|FloorDiv|Mod|Pow)", "(BitOr|BitAnd|BitXor|LShift|RShift)"
ORDER = "(Eq|NotEq|Lt|LtE|Gt|GtE)"
MUTATIONS = re.compile(
    rf"core/(ReplaceBinaryOperator_({SUMS}_{SUMS}|{BITS}_{BITS})|ReplaceUnaryOperator_Delete_\w+|ReplaceComparison"
    rf"Operator_({ORDER}_{ORDER}|Is_IsNot|IsNot_Is)|(?!ReplaceBin|ReplaceUn|ReplaceComp|Variable)\w+)"
)
Reached = dict[str, dict[str, list[str]]]  # file: {line: tests}


def reach() -> Reached:
    """Runs the fast tests under coverage, with the processes that they start."""
    WORK.mkdir(exist_ok=True)
    rc = WORK / "rc"
    rc.write_text(COVERAGE.format(ROOT), encoding="utf-8")
    covered = ["--cov", f"--cov-config={rc}", "--cov-context=test", "--cov-report="]
    subprocess.run([*TESTS, *covered], cwd=ROOT, env={**os.environ, "COVERAGE_PROCESS_START": str(rc)}, check=False)
    found: dict[str, dict[int, set[str]]] = defaultdict(lambda: defaultdict(set))
    for path in WORK.glob("coverage*"):
        data = CoverageData(str(path))
        data.read()
        for file in data.measured_files():
            for line, contexts in data.contexts_by_lineno(file).items():
                tests = {re.sub(r"\|\w+$| \(\w+\)$", "", context) for context in contexts} - {""}
                found[Path(file).relative_to(ROOT).as_posix()][line] |= tests
    return json.loads(json.dumps(found, default=sorted))


def places(source: str) -> dict[Any, list[tuple[str, int]]]:
    """By place, type hints left out: the mutations of Cosmic Ray, each with the number of the place among its own."""
    found, nodes = defaultdict(list), list(ast_nodes(get_ast(source)))
    hints = [getattr(node, name, None) for node in ast.walk(ast.parse(source)) for name in ("annotation", "returns")]
    typed = [((hint.lineno, hint.col_offset), (hint.end_lineno, hint.end_col_offset)) for hint in hints if hint]
    for name in sorted(filter(MUTATIONS.fullmatch, operator_names())):
        spans = [span for node in nodes for span in get_operator(name)().mutation_positions(node)]
        for number, (start, end) in enumerate(spans):
            if not any(low <= start and end <= high for low, high in typed):
                found[start, end].append((name, number))
    return found


class Mutant(NamedTuple):
    """The ``lines`` of a file that a mutation concerns, and the file before and after it."""

    path: Path
    lines: range
    mutation: str
    before: str
    after: str

    @property
    def change(self) -> tuple[int, str, str]:
        """Where the changed lines begin, as an offset; those lines before, and after."""
        was, now = (text.splitlines(keepends=True) for text in (self.before, self.after))
        blocks = SequenceMatcher(None, was, now, autojunk=False).get_opcodes()
        (_, start, _, at, _), *_ = changes = [block for block in blocks if block[0] != "equal"]
        _, _, stop, _, end = changes[-1]
        return len("".join(was[:start])), "".join(was[start:stop]), "".join(now[at:end])


def library(commit: str) -> dict[Path, str]:
    """The source of each file at a commit; "" for the files as they are."""
    if not commit:
        return {path: path.read_text(encoding="utf-8") for path in sorted((ROOT / "sgimd_torch").rglob("*.py"))}
    git = partial(subprocess.check_output, cwd=ROOT, text=True)
    names = git(["git", "ls-tree", "-r", "--name-only", commit, "sgimd_torch"]).splitlines()
    paths = sorted(ROOT / name for name in names if name.endswith(".py"))
    return {path: git(["git", "show", f"{commit}:{path.relative_to(ROOT).as_posix()}"]) for path in paths}


def draw(seed: int, count: int, sources: dict[Path, str]) -> list[Mutant]:
    """As many mutants; each place is as likely as any other."""
    found = {path: places(source) for path, source in sources.items()}
    every = [(path, span) for path in found for span in sorted(found[path])]
    rng, drawn = random.Random(seed), list[Mutant]()
    for path, span in rng.sample(every, len(every)):
        name, number = rng.choice(found[path][span])
        mutant = mutated(sources[path], name, number)
        if mutant:
            drawn.append(Mutant(path, range(span[0][0], span[1][0] + 1), name, sources[path], mutant))
        if len(drawn) == count:
            break
    return drawn


def carried(mutant: Mutant, today: dict[Path, str]) -> Mutant | None:
    """The same change of the file as it is in ``today``; None if its lines are not there, or not as often."""
    start, was, now = mutant.change
    path = next((path for path in (mutant.path, mutant.path.with_suffix("") / "__init__.py") if path in today), None)
    if path is None:
        return None
    lines, source = re.compile(f"^{re.escape(was)}", re.MULTILINE), today[path]
    before, after = ([found.start() for found in lines.finditer(text)] for text in (mutant.before, source))
    if len(before) != len(after):
        return None
    begin = after[before.index(start)]
    first = mutant.lines.start - mutant.before.count("\n", 0, start) + source.count("\n", 0, begin)
    changed = source[:begin] + now + source[begin + len(was) :]
    return Mutant(path, range(first, first + len(mutant.lines)), mutant.mutation, source, changed)


def mutated(source: str, name: str, number: int) -> str:
    """The mutant; "" where Cosmic Ray makes none: a dotted exception, the star of an argument taken for a product."""
    try:
        mutant = str(mutate_code(source, get_operator(name)(), number))
        stars = [ast.dump(ast.parse(each)).count("Starred(") for each in (source, mutant)]
    except (AttributeError, SyntaxError):
        return ""
    return mutant if stars[0] == stars[1] else ""


def judge(mutant: Mutant, reached: Reached) -> tuple[int, str]:
    """How many tests are asked about a mutant, and the one that kills it; "" if none does."""
    path, lines = mutant.path, mutant.lines
    functions = [node for node in ast.walk(ast.parse(mutant.before)) if isinstance(node, ast.FunctionDef)]
    runs_on_import = not any(node.body[0].lineno <= lines.start <= (node.end_lineno or 0) for node in functions)
    here = reached.get(path.relative_to(ROOT).as_posix(), {})
    asked = {test for line in here if runs_on_import or int(line) in lines for test in here[line]}
    if runs_on_import:
        asked.add("tests/test_defaults.py")  # reads signatures, whose lines were reached by whoever imported them first
    length = Counter(test for each in reached.values() for tests in each.values() for test in tests)
    tests, size, killed = sorted(asked, key=lambda test: (length[test], test)), 5, ""
    try:
        path.write_text(mutant.after, encoding="utf-8")
        while tests and not killed:  # a few tests first, so that a mutant without an end is found soon
            killed, tests, size = failure(tests[:size]), tests[size:], 4 * size
    finally:
        path.write_text(mutant.before, encoding="utf-8")
    return len(asked), killed


def failure(tests: list[str]) -> str:
    """The first of these tests that fails; "" if none does."""
    plain = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}  # a restored file can be as old and as long as its mutant
    with subprocess.Popen(
        [*TESTS, "-x", *tests], cwd=ROOT, env=plain, stdout=-1, text=True, process_group=0
    ) as process:
        try:
            said, _ = process.communicate(timeout=60 + 20 * len(tests))
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)  # also what the tests have started
            return "no end"
    failed = re.findall(r"^(?:FAILED|ERROR) (.*?)(?: - .*)?$", said, re.M)
    return "" if not process.returncode else failed[0] if failed else f"exit code {process.returncode}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["reach", "judge"])
    parser.add_argument("--seed", type=int, default=1, help="of the lot")
    parser.add_argument("--count", type=int, default=100, help="mutants in the lot")
    parser.add_argument("--of", default="", metavar="COMMIT", help="whose lot it is (default: the code as it is)")
    parser.add_argument("--only", type=int, nargs="+", help="their numbers in the lot")
    options = parser.parse_args()
    if options.what == "reach":
        (WORK / "reach.json").write_text(json.dumps(reach()), encoding="utf-8")
        return
    reached, today = json.loads((WORK / "reach.json").read_text()), library("")
    drawn = draw(options.seed, options.count, library(options.of))
    with (WORK / f"mutants-{options.seed}.csv").open("a", encoding="utf-8", newline="") as file:
        for number in options.only or range(options.count):
            mutant = carried(drawn[number], today) if options.of else drawn[number]
            asked, killed = judge(mutant, reached) if mutant else (0, "its lines are gone")
            shown = mutant or drawn[number]
            was, now = (" ".join(lines.split()) for lines in shown.change[1:])
            row = [number, shown.path.relative_to(ROOT), shown.lines.start, shown.mutation, was, now, asked]
            csv.writer(file).writerow([*row, killed or "survived"])
            print(*row, killed or "survived", sep=" | ", flush=True)


if __name__ == "__main__":
    main()
