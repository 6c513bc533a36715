"""Versions: scripts/setup installs exactly the pinned packages, the lowest allowed versions work, too, and the workflow
runs the checks of scripts/test on all supported systems and Pythons."""

import importlib.metadata
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
EXTRAS = PROJECT["project"]["optional-dependencies"]
PINNED = dict(
    line.split("==") for line in (ROOT / "constraints.txt").read_text().splitlines() if not line.startswith("#")
)


NAME = PROJECT["project"]["name"]
WORKFLOW = yaml.safe_load((ROOT / ".github/workflows/tests.yml").read_text(encoding="utf-8"))
BUILD = [Requirement(text) for text in PROJECT["build-system"]["requires"]]


def required(*extras):
    """Requirements of the project with some of its extras; an extra that contains other extras is resolved."""
    lists = [PROJECT["project"]["dependencies"], *(EXTRAS[extra] for extra in extras)]
    requirements = [Requirement(text) for texts in lists for text in texts]
    contained = {extra for requirement in requirements if requirement.name == NAME for extra in requirement.extras}
    if contained - {*extras}:
        return required(*{*extras, *contained})
    return [requirement for requirement in requirements if requirement.name != NAME]


def closure(requirements):
    """Names of all packages that these requirements install on this system, directly or indirectly."""
    wanted = [(requirement, extra) for requirement in requirements for extra in requirement.extras | {""}]
    done = set()
    while wanted:
        requirement, extra = wanted.pop()
        name = canonicalize_name(requirement.name)
        if (name, extra) in done:
            continue
        done.add((name, extra))
        for text in importlib.metadata.requires(name) or []:
            further = Requirement(text)
            if further.marker is None or further.marker.evaluate({"extra": extra}):
                wanted += [(further, more) for more in further.extras | {""}]
    return {name for name, _ in done}


def test_everything_that_setup_installs_is_pinned_and_nothing_else():
    assert closure([*required("all", "dev"), *BUILD]) == {canonicalize_name(name) for name in PINNED}


def test_what_is_installed_has_the_pinned_versions():
    installed = {name: importlib.metadata.version(name).partition("+")[0] for name in PINNED}  # "+cpu" is no version
    assert installed == PINNED


def test_every_requirement_says_its_lowest_version():
    for requirement in [*required("all", "dev"), *BUILD]:
        assert [part.operator for part in requirement.specifier].count(">=") == 1, requirement


ABSENT = """import importlib.abc, sys
class Absent(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name in {names}:
            raise ModuleNotFoundError("No module named " + repr(name), name=name)
sys.meta_path.insert(0, Absent())
"""


@pytest.mark.slow
def test_the_demo_needs_no_more_than_its_setup_installs(tmp_path):
    extras = re.search(r'^demo\) extras="(.*?)"', (ROOT / "scripts/setup").read_text(), re.MULTILINE)[1].split(",")
    needed = closure(required(*extras))
    assert not needed & {"torch", "playwright", "viser"}
    absent = {
        module
        for module, names in importlib.metadata.packages_distributions().items()
        if not needed & {canonicalize_name(name) for name in names} and module != "sgimd_torch"
    }
    (tmp_path / "sitecustomize.py").write_text(ABSENT.format(names=absent))
    words = f"-m sgimd_torch demo --movements 20 --evaluate-at 10 --repeats 0 --out {tmp_path}/out".split()
    environment = {**os.environ, "PYTHONPATH": f"{tmp_path}:{ROOT}"}
    done = subprocess.run([sys.executable, *words], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out/demo.png").exists()


def lowest(requirement):
    """A requirement ``name==version`` of the lowest version that ``requirement`` allows."""
    ((version,),) = [[part.version for part in requirement.specifier if part.operator == ">="]]
    extras = f"[{','.join(sorted(requirement.extras))}]" if requirement.extras else ""
    return f"{requirement.name}{extras}=={version}"


@pytest.mark.slow
def test_the_lowest_versions_allowed_install_together_and_pass(tmp_path):
    # About 3 GB to download, as the lowest torch comes with its libraries for GPUs. Linters are not tested.
    wanted = [*required("all", "dev"), *BUILD]
    pins = [lowest(requirement) for requirement in wanted if requirement.name not in ("mypy", "ruff", "pytest-xdist")]
    python = str(tmp_path / "venv/bin/python")
    subprocess.run([sys.executable, "-m", "venv", str(tmp_path / "venv")], check=True)
    install = [python, "-m", "pip", "install", "-q", "--disable-pip-version-check", "--no-cache-dir", *pins]
    done = subprocess.run(install, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    tests = [f"tests/{name}" for name in SMOKE]
    # Old releases cause deprecation warnings in newer versions of Python and numpy.
    words = ["-m", "pytest", "-p", "no:cacheprovider", "-W", "ignore::DeprecationWarning", "-mnot slow", *tests]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([python, *words], cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-5000:] + done.stderr[-2000:]
    assert re.search(r"\d{3,} passed", done.stdout)


SMOKE = (
    *("memory/test_memory.py", "learner/test_strategies.py", "learner/test_session.py", "test_loaders.py"),
    *("environments", "goals", "inverses", "forward_model", "board"),
    *("runs/test_run.py", "extras/rivals", "extras/film/test_film.py"),
)


def test_the_workflow_runs_the_checks_that_one_runs_by_hand_and_builds_a_release():
    (step,) = [step for step in WORKFLOW["jobs"]["test"]["steps"] if step.get("run") == "scripts/test"]
    assert step["env"] == {"PYTHON": "python"}  # the Python that the workflow has set up
    matrix = WORKFLOW["jobs"]["test"]["strategy"]["matrix"]
    assert matrix["python"] == ["3.11", "3.12", "3.13"]
    assert {*matrix["system"], *(entry["system"] for entry in matrix["include"])} == {"ubuntu-latest", "macos-latest"}
    commands = [step["run"] for step in WORKFLOW["jobs"]["package"]["steps"] if "run" in step]
    assert commands[1:] == ["python -m build", "python -m twine check --strict dist/*"]


def test_the_workflow_may_read_only_and_its_actions_have_a_version():
    assert WORKFLOW["permissions"] == {"contents": "read"}
    for job in WORKFLOW["jobs"].values():
        assert "permissions" not in job
        actions = [step["uses"] for step in job["steps"] if "uses" in step]
        assert actions
        assert all(name.rpartition("@v")[2].isdecimal() for name in actions)


def test_only_the_job_that_publishes_can_prove_who_it_is_and_it_publishes_what_was_tried():
    workflow = yaml.safe_load((ROOT / ".github/workflows/release.yml").read_text(encoding="utf-8"))
    build, publish = (workflow["jobs"][name] for name in ("build", "publish"))
    assert workflow["permissions"] == {"contents": "read"}
    assert "permissions" not in build
    assert publish["permissions"] == {"id-token": "write"}
    assert publish["needs"] == "build"
    assert "scripts/release" in [step.get("run") for step in build["steps"]]
    assert [step["uses"].partition("@")[0] for step in publish["steps"]] == [
        *("actions/download-artifact", "pypa/gh-action-pypi-publish")
    ]
