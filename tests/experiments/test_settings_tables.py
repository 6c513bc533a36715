"""Where each idea pays, on made-up rows, and the page results/SETTINGS.md."""

import pytest

from claims import main
from paper import HEADER, spread
from read_results import ResultsError
from settings_tables import EVERYBODY, IDEAS, SETTINGS, ideas_rows, ratios, read_settings, settings_rows, where_it_pays
from sgimd_torch.runs.process import command
from variants import EXPERIMENTS

NAMES = tuple(EXPERIMENTS["settings"])


def write(folder, *, without=(), own=0.4, **errors):
    """All err .2 by `process` and ``own`` by their own inverse; ``errors``: of a learner, with _ for -, by setting."""
    lines = []
    for name in NAMES:
        learner, _, setting = name.partition("@")
        error = errors.get(learner.replace("-", "_"), {}).get(setting, 0.2)
        for seed in range(100, 105):
            for answer, value in (("own", own), ("process", error)):
                if learner.endswith("-model"):
                    value = {"own": error, "process": own}[answer]  # that of process must not count
                lines += [
                    f"settings,{name},,1,{seed},{when},{answer},{value * spread(seed - 100)},,1,1,1"
                    for when in (500, 1000, 2000)
                    if name not in without
                ]
    (folder / "settings.csv").write_text("\n".join([HEADER, *lines]) + "\n")
    return folder


def test_every_setting_has_every_learner_that_it_changes_something_for():
    assert len(NAMES) == 5 * 14 + 3 * 7
    assert {name.partition("@")[2] for name in NAMES} == {*SETTINGS}
    assert {learner for pairs in IDEAS.values() for pair in pairs for learner in pair} <= {*EVERYBODY}


def test_an_idea_pays_where_its_error_is_smaller_and_costs_where_it_is_larger(tmp_path):
    sagg_riac = {"noise-none": 0.1, "swimmer": 0.3}
    results = read_settings(write(tmp_path, sagg_riac=sagg_riac, sgim_d_model={"shuffled": 0.1}))
    lines = where_it_pays(ratios(results)).splitlines()
    interest = "`sagg-riac` in noise-none. It seems to cost: `sagg-riac` in swimmer."
    assert lines[0] == f"- **Choosing goals by interest** seems to pay: {interest}"
    assert lines[1].endswith("pay: `practice` in swimmer. It seems to cost: `practice` in noise-none.")
    assert lines[3].endswith(
        "`sagg-riac-model` in swimmer; `sgim-d-model` in shuffled. It seems to cost: `sagg-riac-model` in noise-none."
    )


def test_under_another_teacher_a_learner_without_one_is_what_it_was(tmp_path):
    results = read_settings(write(tmp_path, sgim_d={"one-corner": 0.3}, sagg_riac={"as-it-is": 0.1}))
    rows = {tuple(row[:2]): row[2:] for row in ideas_rows(ratios(results))}
    shown = dict(zip(SETTINGS, rows["Being shown", "`sgim-d` / `sagg-riac`"], strict=True))
    assert shown["one-corner"].startswith("**3.00 [")
    assert shown["13-shown"].startswith("**2.00 [")
    assert shown["swimmer"] == "1.00 [1.00, 1.00]"
    assert rows["Practice in the place of goal babbling", "`practice` / `sagg-riac`"][len(SETTINGS) - 3 :] == ["-"] * 3
    errors = {row[0]: row[1:] for row in settings_rows(results, 2000)}
    assert errors["`sagg-riac`"][len(SETTINGS) - 3 :] == ["-", "-", "-"]


def test_the_page_says_what_was_not_run_with_a_dash(tmp_path):
    write(tmp_path, without=("practice-taught@swimmer",))
    assert command(main, ["--results", str(tmp_path), "--out", str(tmp_path / "pages"), "--only", "SETTINGS"]) == 0
    page = (tmp_path / "pages/SETTINGS.md").read_text()
    assert "{{" not in page
    head = "| Practice in the place of goal babbling | `practice-taught` /"
    row = next(line for line in page.splitlines() if line.startswith(head))
    same = "1.00 [1.00, 1.00]"
    assert [cell.strip() for cell in row.split("|")[3:-1]] == [*[same] * 4, "-", *[same] * 3]


def test_without_rows_there_is_no_page(tmp_path):
    with pytest.raises(ResultsError, match=r"settings\.csv does not exist"):
        read_settings(tmp_path)
