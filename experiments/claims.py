"""The pages in results/, such as RESULTS.md and LEARNING.md: claims, our numbers, and whether they hold.

Each page is a template in experiments/pages/, which has the text; the tables are put in by name. Change the template,
not the page. The tables come from the rows in --results, which compare.py writes:

  RESULTS         paper.csv, and goals.csv, anova.csv and said.csv (what 0.1 claimed) if they exist
  FORWARD_MODEL   forward_model.csv, and the table of model_figures.py (--table) if it exists
  GYMNASIUM       gymnasium.csv
  LEARNING        learning.csv and suite.csv
  BY_HAND         by_hand.csv
  ASKING          asking.csv, asked.csv and contexts.csv
  SETTINGS        settings.csv
  RIVALS          rivals.csv, which tune_rivals.py writes

ASKING, SETTINGS and RIVALS are left out while there are no rows for them.

Intervals are bootstrapped with a fixed seed, so the same rows give the same page. The analyses of variance need
run directories: --runs makes them again and keeps their rows in anova.csv.

Examples:
  python experiments/claims.py --readme README.md               all pages, and the numbers of the README
  python experiments/claims.py --runs runs --only RESULTS       and the analyses of variance again
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

    from anova import anova_cells, update_anova
    from asking_claims import ASKING_CLAIMS, BLIND, ON_TOSS, contexts_rows, counts, read_asking, teachers_rows
    from judging import Results, judge
    from learning_claims import LEARNING_CLAIMS, TIMES, answers_rows, read_learning
    from model_claims import MODEL_CLAIMS, SIMPLEX
    from page_tables import Cell, markdown, said_table, variants_table, verdicts_table
    from paper_claims import PAPER_CLAIMS
    from quoted import MADE, Page, into_readme, render
    from read_results import LAST, Evaluated, ResultsError, read_coverages, read_goals, read_results, read_said
    from rivals_table import rivals_rows
    from settings_tables import SETTINGS, ideas_rows, ratios, read_settings, settings_rows, where_it_pays
    from sgimd_torch.files import make_folder, write_text
    from sgimd_torch.views.statistics import iqm_interval, metres, rng, show
    from suite_claims import SUITE_COLUMNS, read_suite, suite_claims, suite_rows
    from variants import EXPERIMENTS, LEARNING, ladder

PAGES: Final = ("RESULTS", "FORWARD_MODEL", "GYMNASIUM", "LEARNING", "BY_HAND", "ASKING", "SETTINGS", "RIVALS")
OPTIONAL: Final = {
    "ASKING": "asking.csv",
    "SETTINGS": "settings.csv",
    "RIVALS": "rivals.csv",
}  # pages that are left out without their rows
ANOVA: Final = ("means compared", "of", "dimensions of theta in which they differ", "smallest p", "largest p")
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
YARDSTICKS: Final = ("linear", "process")
NOBODY: Final = Evaluated("", "", {})


def paper_page(folder: Path) -> Page:
    """The page results/RESULTS.md; learners from the worst to the best, other variants in the order of their rows."""
    path = folder / "paper.csv"
    own = Results(read_results(path), read_goals(folder / "goals.csv"), same=read_results(path, "linear"))
    proved = Results(read_results(path, "process"))
    verdicts, results, variants = judge(PAPER_CLAIMS, own), own.alike, own.same
    learners = sorted((v for v in variants.values() if v.experiment == "learners"), key=lambda v: -_last_error(v))
    others = [variant for variant in variants.values() if variant.experiment != "learners"]
    better, difference = _against(results, lambda _: "sgim-d", LAST)
    columns = {
        "experiment": lambda name: variants[name].experiment,
        **_errors(results, (1000, LAST), ".3f"),
        f"by its own inverse at {LAST} (m)": _error(own),
        f"by `LocalProcess` at {LAST} (m)": _error(proved),
        "mean over life (m)": lambda name: show(iqm_interval(results.lives(name), rng=rng()), ".3f"),
        "SGIM-D better, probability": better,
        "difference to SGIM-D (m)": difference,
        "tiles reached": lambda name: show(own.iqm(name, values="tiles"), ".0f"),
        "goals claimed": lambda name: show(own.iqm(name, values="claimed"), ".0f"),
        "goals met": lambda name: show(results.iqm(name, values="met"), ".0f"),
    }
    tables = {
        "ladder": _ladder_table(own, proved, ""),
        "ladder_large": _ladder_table(own, proved, "-large"),
        "claims": verdicts_table("claim", verdicts),
        "said": said_table(read_said(folder / "said.csv"), verdicts),
        "learners": variants_table([variant.variant for variant in learners], columns),
        "ablations": variants_table([variant.variant for variant in others], columns),
        "anova": markdown(ANOVA, anova_cells(folder / "anova.csv")),
        "readme": _readme_table(own, proved),
    }
    return Page(verdicts, tables, own, {"proved": proved})


def model_page(folder: Path, table: Path) -> Page:
    """The page results/FORWARD_MODEL.md; variants in the order of ``EXPERIMENTS``."""
    path = folder / "forward_model.csv"
    results = Results(read_results(path), coverages=read_coverages(table), same=read_results(path, "linear"))
    proved = Results(read_results(path, "process"))
    verdicts = judge(MODEL_CLAIMS, results)
    tables = {"bars": verdicts_table("what", verdicts)}
    for experiment, (ending, times) in MODEL_TABLES.items():
        better, difference = _against(results, partial(_plain_learner, ending), times[-1])
        columns = {
            **_errors(results, times, ".4f"),
            f"difference to the plain learner at {times[-1]} (m)": difference,
            "plain better, probability": better,
            f"by `LocalProcess` at {times[-1]} (m)": _error(proved, times[-1], ".4f"),
        }
        names = [name for name in EXPERIMENTS[experiment] if name in results.variants]
        tables[experiment] = variants_table(names, columns)
    return Page(verdicts, tables, results, {"proved": proved})


def gymnasium_page(folder: Path) -> Page:
    """The page results/GYMNASIUM.md: each way to explore, answered in each way."""
    path = folder / "gymnasium.csv"
    by_answer = {answer: Results(read_results(path, answer)) for answer in ("nearest", "linear", "model", "process")}
    rows = [
        (name, answer)
        for name in EXPERIMENTS["swimmer"]
        for answer, results in by_answer.items()
        if name in results.variants and results.variants[name].rows
    ]
    columns: dict[str, Callable[[str, str], str]] = {
        "explored by": lambda name, _: f"`{name.removesuffix('-swimmer')}`",
        "answered by": lambda _, answer: f"`{answer}`",
        "seeds": lambda name, answer: str(len(by_answer[answer].at(name, ON_ARMS[-1]))),
        **{
            f"error at {when} (m)": partial(
                lambda when, name, answer: show(by_answer[answer].iqm(name, when), ".3f"), when
            )
            for when in ON_ARMS
        },
    }
    cells = [[cell(name, answer) for cell in columns.values()] for name, answer in rows]
    return Page([], {"swimmer": markdown([*columns], cells)}, by_answer["process"], by_answer)


def learning_page(folder: Path) -> Page:
    """The page results/LEARNING.md: few movements, on the rod and on the suite."""
    rod, suite, times = read_learning(folder / "learning.csv"), read_suite(folder), (*TIMES, LAST)
    verdicts, on_suite = judge(LEARNING_CLAIMS, rod["judged"]), judge(suite_claims(suite), suite["process"])
    names = sorted(LEARNING, key=lambda name: _last_error(rod["process"].variants.get(name, NOBODY)))
    columns = {
        **_errors(rod["process"], times, ".4f"),
        "by its own": _error(rod["own"], LAST, ".4f"),
        "by `linear`": _error(rod["linear"], LAST, ".4f"),
        "times its noise floor": lambda name: show(rod["own"].floor_ratio(name, name)),
    }
    on_tasks = ["task", "seeds", "random, `nearest`", *(f"{name}, `{answer}`" for name, answer in SUITE_COLUMNS)]
    tables = {
        "claims": verdicts_table("what", verdicts),
        "suite_claims": verdicts_table("what", on_suite),
        "rod": variants_table(names, columns),
        "answers": markdown(["memory of", "over", *map(str, times)], answers_rows(rod)),
        **{f"suite_{when}": markdown(on_tasks, suite_rows(suite, when)) for when in TIMES},
    }
    return Page([*verdicts, *on_suite], tables, rod["judged"], {"linear": rod["linear"]})


def hand_page(folder: Path) -> Page:
    """The page results/BY_HAND.md: each learner alone, with ten lessons by hand, and with ten shipped ones."""
    results = Results(read_results(folder / "by_hand.csv"))
    columns = _errors(results, EARLY, ".3f")
    for when in (EARLY[0], EARLY[-1]):
        _, columns[f"difference to the same learner alone at {when} (m)"] = _against(results, _alone, when)
    return Page([], {"by-hand": variants_table([*EXPERIMENTS["by-hand"]], columns)}, results)


def asking_page(folder: Path) -> Page:
    """The page results/ASKING.md: when to ask, whom and what for."""
    results = read_asking(folder)
    alike, verdicts = results.alike, judge(ASKING_CLAIMS, results)

    def requests(what: str) -> Cell:
        def cell(name: str) -> str:
            found = np.array([*counts(results, name, what).values()])
            return show(iqm_interval(found, rng=rng()), ".0f")

        return cell

    asked = {"demonstrations": requests("shown"), "requests": requests("requests")}
    wind = {"in a strong wind": requests("strong"), "in a weak one": requests("weak")}
    names = [name for name in EXPERIMENTS["asking"] if name not in (*ON_TOSS, BLIND)]
    names.sort(key=lambda name: _last_error(alike.variants.get(name, NOBODY)))
    asked_whom = ["variant", "teacher", "requests", "answered", "late", "late, in their half"]
    tables = {
        "claims": verdicts_table("what", verdicts),
        "rod": variants_table(names, {**_errors(alike, (*TIMES, LAST), ".4f"), **asked}),
        "teachers": markdown(asked_whom, teachers_rows(results)),
        "toss": variants_table((*ON_TOSS, BLIND), {**_errors(alike, TIMES, ".4f"), **asked, **wind}),
        "contexts": markdown(["variant", "wind (m/s²)", "error (m)"], contexts_rows(folder)),
    }
    return Page(verdicts, tables, results)


def settings_page(folder: Path) -> Page:
    """The page results/SETTINGS.md: where each idea pays."""
    results = read_settings(folder)
    found = ratios(results)
    tables = {
        "where": where_it_pays(found),
        "ideas": markdown(["idea", "errors", *SETTINGS], ideas_rows(found)),
        **{f"settings_{when}": markdown(["learner", *SETTINGS], settings_rows(results, when)) for when in (500, 2000)},
    }
    return Page([], tables, results)


def rivals_page(folder: Path) -> Page:
    """The page results/RIVALS.md: the search for their settings."""
    when = ("1000", f"{LAST}", f"{LAST}, later seeds")
    head = ["rival", "setting", *(f"`{answer}` at {at}" for at in when for answer in YARDSTICKS)]
    return Page([], {"rivals": markdown(head, rivals_rows(folder / "rivals.csv"))}, Results({}))


def _alone(name: str) -> str:
    """The same learner without a teacher."""
    return f"{name.partition('-')[0]}-alone"


def _readme_table(own: Results, proved: Results) -> str:
    """The learners and their peers in short."""
    columns: dict[str, Cell] = {
        "learner": lambda name: IN_README[name],
        "error after 1000 (m)": _error(own.alike, 1000),
        f"after {LAST} (m)": _error(own.alike),
        f"after {LAST}, by its own inverse (m)": _error(own),
        f"after {LAST}, by `LocalProcess` (m)": _error(proved),
        "seeds": lambda name: str(len(own.alike.at(name))),
    }
    return variants_table([*IN_README], columns)


def _ladder_table(own: Results, proved: Results, ending: str) -> str:
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
        f"by `LocallyLinear` at {LAST} (m)": _error(own.alike),
        "difference, by `LocallyLinear` (m)": step(own.alike),
        f"by `LocalProcess` at {LAST} (m)": _error(proved),
    }
    return variants_table(names, columns)


def _errors(results: Results, times: Sequence[int], form: str) -> dict[str, Cell]:
    """A variant's name, how many of its seeds reached the last of these ``times``, its errors at each of them."""
    return {
        "variant": str,
        "seeds": lambda name: str(len(results.variants[name].at(times[-1])) if name in results.variants else 0),
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


def _last_error(variant: Evaluated) -> float:
    """Mean over seeds at the end; inf if it was never evaluated there."""
    return float(np.mean(list(variant.at(LAST).values()) or [np.inf]))


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
    parser.add_argument("--table", type=Path, help="of model_figures.py (default: model/table.csv in --results)")
    parser.add_argument("--runs", type=Path, help="run directories, to make the analyses of variance again")
    parser.add_argument("--out", type=Path, default=results, help="folder of the pages (default: %(default)s)")
    parser.add_argument("--only", choices=PAGES, help="only this page")
    parser.add_argument("--readme", type=Path, help="a README whose section of results is made again, too")
    options = parser.parse_args(argv)
    folder, table = options.results, options.table or options.results / "model" / "table.csv"
    makers = {
        "RESULTS": lambda: paper_page(folder),
        "FORWARD_MODEL": lambda: model_page(folder, table),
        "GYMNASIUM": lambda: gymnasium_page(folder),
        "LEARNING": lambda: learning_page(folder),
        "BY_HAND": lambda: hand_page(folder),
        "ASKING": lambda: asking_page(folder),
        "SETTINGS": lambda: settings_page(folder),
        "RIVALS": lambda: rivals_page(folder),
    }
    missing = {name: file for name, file in OPTIONAL.items() if not (options.only or (folder / file).exists())}
    say(*(f"{name} is left out: there is no {folder / file} yet" for name, file in missing.items()))
    paths = {name: options.out / f"{name}.md" for name in PAGES if options.only in (None, name)}
    for path in paths.values():
        _check_place(path)
    paths = {name: path for name, path in paths.items() if name not in missing}
    if options.runs is not None:
        update_anova(folder / "anova.csv", options.runs)
    pages = {name: makers[name]() for name in paths}
    texts = {name: render(name, page) for name, page in pages.items()}
    if options.readme is not None:
        paper, model = (pages.get(name) or makers[name]() for name in ("RESULTS", "FORWARD_MODEL"))
        rod = read_learning(folder / "learning.csv")
        more = {"model": model.results, **{answer: rod[answer] for answer in YARDSTICKS}}
        write_text(options.readme, into_readme(options.readme.read_text(encoding="utf-8"), paper, **more))
    make_folder(options.out)
    for name, path in paths.items():
        write_text(path, texts[name])
        found = [row.verdict for row in pages[name].verdicts]
        counts = ", ".join(f"{found.count(verdict)} {verdict}" for verdict in dict.fromkeys(found))
        print(f"{path}: {len(found)} claims: {counts}")
    return 0


if __name__ == "__main__":
    sys.exit(command(main))
