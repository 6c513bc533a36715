"""The workflow for every change: the checks of scripts/test, on all supported systems and Pythons."""

from pathlib import Path

import yaml

ROOT = Path(__file__).parents[2]
WORKFLOW = yaml.safe_load((ROOT / ".github" / "workflows" / "tests.yml").read_text(encoding="utf-8"))


def runs_of(job):
    return [step["run"] for step in WORKFLOW["jobs"][job]["steps"] if "run" in step]


def test_it_runs_the_checks_that_one_runs_by_hand():
    (step,) = [step for step in WORKFLOW["jobs"]["test"]["steps"] if step.get("run") == "scripts/test"]
    assert step["env"] == {"PYTHON": "python"}  # the Python that the workflow has set up
    matrix = WORKFLOW["jobs"]["test"]["strategy"]["matrix"]
    assert matrix["python"] == ["3.11", "3.12", "3.13"]
    assert {*matrix["system"], *(each["system"] for each in matrix["include"])} == {"ubuntu-latest", "macos-latest"}


def test_it_builds_and_checks_what_a_release_consists_of():
    assert runs_of("package")[1:] == ["python -m build", "python -m twine check --strict dist/*"]


def test_it_may_read_only_and_its_actions_have_a_version():
    assert WORKFLOW["permissions"] == {"contents": "read"}
    for job in WORKFLOW["jobs"].values():
        assert "permissions" not in job
        used = [step["uses"] for step in job["steps"] if "uses" in step]
        assert used
        assert all(name.rpartition("@v")[2].isdecimal() for name in used)
