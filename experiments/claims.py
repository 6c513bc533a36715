"""The pages in results/, such as RESULTS.md and LEARNING.md: claims, our numbers, and whether they hold.

Each page is a template in experiments/pages/, which has the text; the tables are put in by name. Change the template,
not the page. The tables come from results.csv in --results, which compare.py writes, and from the small tables beside
it: goals.csv, asked.csv, contexts.csv, said.csv (what 0.1 claimed), and rivals.csv. A page
without rows is left out.

Intervals are bootstrapped with a fixed seed, so the same rows give the same page.

Examples:
  python experiments/claims.py --readme README.md               all pages, and the numbers of the README
  python experiments/claims.py --only RESULTS                   one of them
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Final

from sgimd_torch.runs.process import command, loading, say

with loading():  # Ctrl-C shows no traceback
    import numpy as np

    from asking_claims import ASKING_CLAIMS, BLIND, ON_TOSS, counts
    from judging import LAST, Results, judge
    from learning_claims import LEARNING_CLAIMS, SUITE_CLAIMS, TIMES
    from page_tables import (
        SETTINGS,
        SUITE_COLUMNS,
        Cell,
        answers_rows,
        contexts_rows,
        ideas_rows,
        markdown,
        ratios,
        rivals_rows,
        said_table,
        settings_rows,
        suite_rows,
        teachers_rows,
        variants_table,
        verdicts_table,
        where_it_pays,
    )
    from paper_claims import MODEL_CLAIMS, PAPER_CLAIMS, SIMPLEX
    from quoted import MADE, Page, into_readme, render
    from sgimd_torch.files import make_folder, write_text
    from sgimd_torch.views.statistics import iqm_interval, metres, rng, show
    from table import ResultsError, read_table
    from variants import EXPERIMENTS, LEARNING, PAPER, ladder

ON_ARMS: Final = (250, 500, 1000, 2000)
EARLY: Final = (300, 500, 1000)
# For the forward model's page: how names of variants end, and at which movements they are evaluated.
MODEL_TABLES: Final = {
    "forward-model": ("", (500, 1000, 2000, LAST)),
    "planar-arm-7": ("-arm-7", ON_ARMS),
    "planar-arm-50": ("-arm-50", ON_ARMS),
}
IN_README: Final = {
    "observation": "Observation",
    "random": "Random",
    "sagg-riac": "SAGG-RIAC",
    "imitation": "Imitation",
    "sgim-d-letter": "SGIM-D, the paper to the letter",
    "sgim-d": "**SGIM-D, our defaults**",
    "random-goals-demonstrations": "uniform goals, demonstrations, noise around the nearest movement",
    "cma-mae": "CMA-MAE that saves effort, no teacher",
}


def paper_page(folder: Path) -> Page:
    """The page results/RESULTS.md; learners from the worst to the best, other variants as in ``EXPERIMENTS``."""
    own = Results.of(folder, PAPER, ["goals.csv"])
    alike, proved = own.by("linear"), own.by("process")
    verdicts = judge(PAPER_CLAIMS, own, "linear")
    experiment_of = {name: each for each in PAPER for name in EXPERIMENTS[each]}
    learners = [*EXPERIMENTS["learners"]]
    others = own.known([name for name in experiment_of if name not in learners])
    better, difference = _against(alike, lambda _: "sgim-d", LAST)
    columns = {
        "experiment": lambda name: experiment_of[name],
        **_errors(alike, (1000, LAST), ".3f"),
        f"by its own inverse at {LAST} (m)": _error(own),
        f"by `LocalProcess` at {LAST} (m)": _error(proved),
        "mean over life (m)": lambda name: show(iqm_interval(alike.lives(name), rng=rng()), ".3f"),
        "SGIM-D better, probability": better,
        "difference to SGIM-D (m)": difference,
        "tiles reached": lambda name: show(own.iqm(name, values="tiles"), ".0f"),
        "goals claimed": lambda name: show(own.iqm(name, values="claimed"), ".0f"),
        "goals met": lambda name: show(alike.iqm(name, values="met"), ".0f"),
    }
    tables = {
        "ladder": _ladder_table(own, ""),
        "ladder_large": _ladder_table(own, "-large"),
        "claims": verdicts_table("claim", verdicts),
        "said": said_table(read_table(folder, "said.csv"), verdicts),
        "learners": variants_table(_by_error(alike, learners)[::-1], columns),
        "ablations": variants_table(others, columns),
    }
    return Page(verdicts, tables, {"own": own, "alike": alike, "proved": proved})


def readme_page(folder: Path) -> Page:
    """The section of results in README.md: the learners and their peers in short."""
    own, model, rod = (Results.of(folder, each) for each in (PAPER, ["forward-model"], ["learning"]))
    alike = own.by("linear")
    columns: dict[str, Cell] = {
        "learner": lambda name: IN_README[name],
        "error after 1000 (m)": _error(alike, 1000),
        f"after {LAST} (m)": _error(alike),
        f"after {LAST}, by its own inverse (m)": _error(own),
        f"after {LAST}, by `LocalProcess` (m)": _error(own.by("process")),
        "seeds": lambda name: str(len(alike.at(name))),
    }
    quoted = {"alike": alike, "model": model, "linear": rod.by("linear"), "process": rod.by("process")}
    return Page([], {"readme": variants_table([*IN_README], columns)}, quoted)


def model_page(folder: Path) -> Page:
    """The page results/FORWARD_MODEL.md; variants in the order of ``EXPERIMENTS``."""
    own = Results.of(folder, MODEL_TABLES)
    alike, proved = own.by("linear"), own.by("process")
    verdicts = judge(MODEL_CLAIMS, own, "linear")
    tables = {"bars": verdicts_table("what", verdicts)}
    for experiment, (ending, times) in MODEL_TABLES.items():
        better, difference = _against(own, partial(_plain_learner, ending), times[-1])
        columns = {
            **_errors(own, times, ".4f"),
            f"difference to the plain learner at {times[-1]} (m)": difference,
            "plain better, probability": better,
            f"by `LocalProcess` at {times[-1]} (m)": _error(proved, times[-1], ".4f"),
        }
        tables[experiment] = variants_table(own.known(EXPERIMENTS[experiment]), columns)
    return Page(verdicts, tables, {"own": own, "alike": alike, "proved": proved})


def gymnasium_page(folder: Path) -> Page:
    """The page results/GYMNASIUM.md: each way to explore, answered in each way."""
    results = Results.of(folder, ["swimmer"])
    answers = {answer: results.by(answer) for answer in ("nearest", "linear", "model-alone", "process")}
    cells = [
        [
            *(f"`{name.removesuffix('-swimmer')}`", f"`{answer}`", str(len(found.at(name, ON_ARMS[-1])))),
            *(show(found.iqm(name, when), ".3f") for when in ON_ARMS),
        ]
        for name in EXPERIMENTS["swimmer"]
        for answer, found in answers.items()
        if found.some(name, ON_ARMS[-1])
    ]
    head = ["explored by", "answered by", "seeds", *(f"error at {when} (m)" for when in ON_ARMS)]
    return Page([], {"swimmer": markdown(head, cells)}, {**answers, "own": answers["process"]})


def learning_page(folder: Path) -> Page:
    """The page results/LEARNING.md: few movements, on the rod and on the suite."""
    own, times = Results.of(folder, ["learning", "suite"]), (*TIMES, LAST)
    process, linear = own.by("process"), own.by("linear")
    verdicts, on_suite = (judge(claims, own, "process") for claims in (LEARNING_CLAIMS, SUITE_CLAIMS))
    columns = {
        **_errors(process, times, ".4f"),
        "by its own": _error(own, LAST, ".4f"),
        "by `linear`": _error(linear, LAST, ".4f"),
        "times its noise floor": lambda name: show(own.floor_ratio(name, name)),
    }
    on_tasks = ["task", "seeds", "random, `nearest`", *(f"{name}, `{answer}`" for name, answer in SUITE_COLUMNS)]
    tables = {
        "claims": verdicts_table("what", verdicts),
        "suite_claims": verdicts_table("what", on_suite),
        "rod": variants_table(_by_error(process, [*LEARNING]), columns),
        "answers": markdown(["memory of", "over", *map(str, times)], answers_rows(own)),
        **{f"suite_{when}": markdown(on_tasks, suite_rows(own, when)) for when in TIMES},
    }
    return Page([*verdicts, *on_suite], tables, {"own": own, "alike": process, "linear": linear})


def hand_page(folder: Path) -> Page:
    """The page results/BY_HAND.md: each learner alone, with ten lessons by hand, and with ten shipped ones."""
    results = Results.of(folder, ["by-hand"])
    columns = _errors(results, EARLY, ".3f")
    for when in (EARLY[0], EARLY[-1]):
        alone = _against(results, lambda name: f"{name.partition('-')[0]}-alone", when)
        columns[f"difference to the same learner alone at {when} (m)"] = alone[1]
    return Page([], {"by-hand": variants_table([*EXPERIMENTS["by-hand"]], columns)}, {"own": results})


def asking_page(folder: Path) -> Page:
    """The page results/ASKING.md: when to ask, whom and what for."""
    results = Results.of(folder, ["asking"], ["asked.csv"]).by("process")
    verdicts = judge(ASKING_CLAIMS, results, "process")

    def requests(what: str) -> Cell:
        def cell(name: str) -> str:
            found = np.array([*counts(results, name, what).values()])
            return show(iqm_interval(found, rng=rng()), ".0f")

        return cell

    asked = {"demonstrations": requests("shown"), "requests": requests("requests")}
    wind = {"in a strong wind": requests("strong"), "in a weak one": requests("weak")}
    names = [name for name in EXPERIMENTS["asking"] if name not in (*ON_TOSS, BLIND)]
    asked_whom = ["variant", "teacher", "requests", "answered", "late", "late, in their half"]
    tables = {
        "claims": verdicts_table("what", verdicts),
        "rod": variants_table(_by_error(results, names), {**_errors(results, (*TIMES, LAST), ".4f"), **asked}),
        "teachers": markdown(asked_whom, teachers_rows(results.small["asked.csv"])),
        "toss": variants_table((*ON_TOSS, BLIND), {**_errors(results, TIMES, ".4f"), **asked, **wind}),
        "contexts": markdown(
            ["variant", "wind (m/s²)", "error (m)"], contexts_rows(read_table(folder, "contexts.csv"))
        ),
    }
    return Page(verdicts, tables, {"alike": results})


def settings_page(folder: Path) -> Page:
    """The page results/SETTINGS.md: where each idea pays."""
    results = Results.of(folder, ["settings"])
    found = ratios(results)
    tables = {
        "where": where_it_pays(found),
        "ideas": markdown(["idea", "errors", *SETTINGS], ideas_rows(found)),
        **{f"settings_{when}": markdown(["learner", *SETTINGS], settings_rows(results, when)) for when in (500, 2000)},
    }
    return Page([], tables, {"own": results})


def rivals_page(folder: Path) -> Page:
    """The page results/RIVALS.md: the search for their settings."""
    when = ("1000", f"{LAST}", f"{LAST}, later seeds")
    head = ["rival", "setting", *(f"`{answer}` at {at}" for at in when for answer in ("linear", "process"))]
    return Page([], {"rivals": markdown(head, rivals_rows(folder))}, {})


# What makes each page, and the experiment of results.csv without which it is left out, or a table of its own.
PAGES: Final[dict[str, tuple[Callable[[Path], Page], str]]] = {
    "RESULTS": (paper_page, "learners"),
    "FORWARD_MODEL": (model_page, "forward-model"),
    "GYMNASIUM": (gymnasium_page, "swimmer"),
    "LEARNING": (learning_page, "learning"),
    "BY_HAND": (hand_page, "by-hand"),
    "ASKING": (asking_page, "asking"),
    "SETTINGS": (settings_page, "settings"),
    "RIVALS": (rivals_page, "rivals.csv"),
}


def _ladder_table(own: Results, ending: str) -> str:
    """The steps from the letter to our defaults: the error of each, and the difference that it makes."""
    names = ladder(ending)
    before = dict(zip(names[1:], names, strict=False))

    def step(results: Results) -> Cell:
        def cell(name: str) -> str:
            return metres(results.difference(name, before[name])).removesuffix(" m") if name in before else ""

        return cell

    columns = {
        **_errors(own, (1000, LAST), ".3f"),
        "difference to the step before (m)": step(own),
        f"by `LocallyLinear` at {LAST} (m)": _error(own.by("linear")),
        "difference, by `LocallyLinear` (m)": step(own.by("linear")),
        f"by `LocalProcess` at {LAST} (m)": _error(own.by("process")),
    }
    return variants_table(names, columns)


def _errors(results: Results, times: Sequence[int], form: str) -> dict[str, Cell]:
    """A variant's name, how many of its seeds reached the last of these ``times``, its errors at each of them."""
    return {
        "variant": str,
        "seeds": lambda name: str(len(results.some(name, times[-1]))),
        **{f"error at {when} (m)": _error(results, when, form) for when in times},
    }


def _error(results: Results, when: int = LAST, form: str = ".3f") -> Cell:
    """A column: the error of a variant (m), with its interval."""
    return lambda name: show(results.iqm(name, when), form)


def _against(results: Results, plain: Callable[[str], str], movements: int) -> tuple[Cell, Cell]:
    """Two columns that compare a variant with its ``plain`` learner: how likely that one is better; the difference on
    common seeds, above 0 if its error is smaller. Empty for the plain learner itself."""

    def better(name: str) -> str:
        return "" if name == plain(name) else show(results.improvement(plain(name), name, movements))

    def difference(name: str) -> str:
        if name == plain(name):
            return ""
        pairs, _ = results.pairs(name, plain(name), movements)
        few = f" ({len(pairs)} pairs)" if len(pairs) < len(results.at(name, movements)) else ""
        return metres(results.difference(name, plain(name), movements)).removesuffix(" m") + few

    return better, difference


def _plain_learner(ending: str, name: str) -> str:
    """The same learner without model and with the simplex."""
    return next((each for each in ("sagg-riac", "imitation") if name.startswith(each)), SIMPLEX) + ending


def _by_error(results: Results, names: Sequence[str]) -> list[str]:
    """From the smallest mean error at the end to the largest; those without one come last."""
    return sorted(names, key=lambda name: float(np.mean([*results.some(name).values()] or [np.inf])))


def _check_place(path: Path) -> None:
    """Raises ResultsError if a file that is not one of our pages would be overwritten."""
    if path.is_file() and not path.read_bytes().startswith(MADE.encode()):
        raise ResultsError(
            f"{path} was not made by claims.py and is left as it is; move it away, or name another --out"
        )


def main(argv: Sequence[str] | None = None) -> int:
    """Make the pages; the exit code is 2, and no page is changed, if the rows make no sense."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    results = Path("results")
    parser.add_argument("--results", type=Path, default=results, help="folder of the rows (default: %(default)s)")
    parser.add_argument("--out", type=Path, default=results, help="folder of the pages (default: %(default)s)")
    parser.add_argument("--only", choices=PAGES, help="only this page")
    parser.add_argument("--readme", type=Path, help="a README whose section of results is made again, too")
    options = parser.parse_args(argv)
    folder = options.results
    paths = {name: options.out / f"{name}.md" for name in PAGES if options.only in (None, name)}
    for path in paths.values():
        _check_place(path)
    there = {*read_table(folder).experiment} | {path.name for path in folder.glob("*.csv")}
    if missing := [
        f"{name} is left out: {folder} has no rows of {PAGES[name][1]}" for name in paths if PAGES[name][1] not in there
    ]:
        say(*missing)
    pages = {name: PAGES[name][0](folder) for name in paths if PAGES[name][1] in there}
    texts = {name: render(name, page) for name, page in pages.items()}
    if options.readme is not None:
        write_text(options.readme, into_readme(options.readme.read_text(encoding="utf-8"), readme_page(folder)))
    make_folder(options.out)
    for name, page in pages.items():
        write_text(paths[name], texts[name])
        found = [row.verdict for row in page.verdicts]
        counted = ", ".join(f"{found.count(verdict)} {verdict}" for verdict in dict.fromkeys(found))
        print(f"{paths[name]}: {len(found)} claims: {counted}")
    return 0


if __name__ == "__main__":
    sys.exit(command(main))
