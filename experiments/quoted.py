"""Pages from their templates; figures that prose quotes are computed from the rows, so that they cannot drift.

A template has the results by each of the answers that its page compares:
    SGIM-D ends at {{ alike.error("sgim-d") }} m, {{ alike.less("sgim-d", "imitation") }} m below Imitation.
What was not run is quoted as "(not run)".
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Final, NamedTuple, ParamSpec

import jinja2

from judging import LAST, NotRun, Results, Verdict
from sgimd_torch.views.statistics import Interval, show
from table import ResultsError

Arguments = ParamSpec("Arguments")
MISSING: Final = "(not run)"
TEMPLATES: Final = Path(__file__).with_name("pages")
MADE: Final = "<!-- Made by experiments/claims.py"
BEGIN, END = "<!-- results: made by experiments/claims.py from experiments/pages/README.md.j2 -->", "<!-- end -->"


def _or_missing(figure: Callable[Arguments, str]) -> Callable[Arguments, str]:
    @wraps(figure)
    def quoted(*arguments: Arguments.args, **options: Arguments.kwargs) -> str:
        try:
            return figure(*arguments, **options)
        except NotRun:
            return MISSING

    return quoted


@dataclass(frozen=True)
class Quoted:
    """Figures from these results; ``at`` is a number of movements, ``form`` how a number is written."""

    results: Results

    @property
    def range(self) -> str:
        """The first and the last seed: ``100 to 119``."""
        return f"{self.results.seeds[0]} to {self.results.seeds[-1]}"

    @_or_missing
    def error(self, name: str, at: int = LAST, form: str = ".3f") -> str:
        """The error (m) of a variant."""
        return f"{self.results.iqm(name, at).value:{form}}"

    @_or_missing
    def interval(self, name: str, at: int = LAST, form: str = ".3f", values: str = "error") -> str:
        """The same with its interval, or another column of an evaluation."""
        return show(self.results.iqm(name, at, values), form)

    @_or_missing
    def less(self, ours: str, theirs: str, at: int = LAST, form: str = ".3f") -> str:
        """How much smaller (m) our error is than theirs, paired by seed, with its interval."""
        found = self.results.difference(ours, theirs, at)
        return show(Interval(-found.value, -found.high, -found.low), form).replace("-", "−")

    @_or_missing
    def ratio(self, ours: str, theirs: str, at: int = LAST, form: str = ".2f") -> str:
        """Our error over theirs."""
        return f"{self.results.ratio(ours, theirs, at).value:{form}}"

    @_or_missing
    def percent_more(self, ours: str, theirs: str, at: int = LAST) -> str:
        """How many percent larger our error is, with its interval."""
        value, low, high = (100 * (each - 1) for each in self.results.ratio(ours, theirs, at))
        return f"{value:.0f} % [{low:.0f}, {high:.0f}]"

    @_or_missing
    def floor(self, name: str, form: str = ".3f") -> str:
        """The noise floor (m) of a variant's own answers."""
        return f"{self.results.iqm(name, LAST, 'floor').value:{form}}"

    @_or_missing
    def times_the_floor(self, ours: str, theirs: str) -> str:
        """Our error over their noise floor, with its interval."""
        return show(self.results.floor_ratio(ours, theirs))

    @_or_missing
    def near_goals(self, name: str) -> str:
        """The share of the goals chosen by all seeds together that can be reached: ``43.4 %``."""
        chosen, near = self.results.near_goals(name).sum(axis=0)
        return f"{100 * near / chosen:.1f} %"

    @_or_missing
    def seeds(self, name: str, at: int = LAST) -> str:
        """How many seeds of a variant were evaluated."""
        return str(len(self.results.at(name, at)))

    @_or_missing
    def common(self, ours: str, theirs: str, at: int = LAST) -> str:
        """How many seeds both have."""
        return str(len(self.results.pairs(ours, theirs, at)[0]))

    @_or_missing
    def one_sign(self, name: str) -> str:
        """How often by chance alone paired differences of all seeds of a variant have one sign: ``one of 16``."""
        return f"one of {2 ** (len(self.results.at(name)) - 1)}"

    @_or_missing
    def worse_in(self, ours: str, theirs: str, at: int = LAST) -> str:
        """In how many of the common seeds our error is larger: ``8 of 10``."""
        found, others = self.results.pairs(ours, theirs, at)
        return f"{sum(found[seed] > others[seed] for seed in found)} of {len(found)}"

    def lowest(self, names: Sequence[str], beside: str, at: int = LAST) -> str:
        """The name of the variant with the smallest error, each compared with the one ``beside`` on common seeds."""
        known = [name for name in names if self.common(name, beside, at) != MISSING]
        return min(known, key=lambda name: self.results.difference(name, beside, at).value) if known else MISSING


class Page(NamedTuple):
    """What is put into a template: verdicts, tables by name, and results by the names that its text has for them."""

    verdicts: Sequence[Verdict]
    tables: Mapping[str, str]
    quoted: Mapping[str, Results]


def render(name: str, page: Page) -> str:
    """The text of a page: its template with the tables and the figures of its prose put in."""
    made = f"{MADE} from experiments/pages/{name}.md.j2; change that file, not this one. -->"
    return f"{made}\n\n{_filled(name, page)}"


def into_readme(text: str, page: Page) -> str:
    """A README with its section of results made again.

    Raises:
        ResultsError: it has no such section.
    """
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ResultsError(f"the README must have a section from {BEGIN} to {END}; was it edited?")
    return f"{before}{BEGIN}\n{_filled('README', page)}{END}{after}"


def _filled(name: str, page: Page) -> str:
    loader = jinja2.FileSystemLoader(TEMPLATES)
    environment = jinja2.Environment(loader=loader, undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    figures = {each: Quoted(results) for each, results in page.quoted.items()}
    return environment.get_template(f"{name}.md.j2").render(tables=page.tables, **figures)
