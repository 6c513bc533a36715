"""What the README, CONTRIBUTING and the pages in docs/ show works as it stands.

A block of a page says in its first line what is done with it:
    ```python              runs, in the folder of its page, with names of its own
    ```python toss.py      is saved there under that name
    ```xml arm.xml         is saved there, too
    ```sh                  commands, carried out line by line
    ```                    commands that take too long: those of sgimd are read, up to where the work would begin
    ```text                is looked at only
    ```py PATH             lines of that file, compared with it by tests/docs/test_links.py
    ```math                an equation
"""

import importlib
import re
import runpy
import shlex
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

import sgimd_torch
from own import MODULE
from sgimd_torch.__main__ import _call
from sgimd_torch.options.catalogue import WORDS
from sgimd_torch.options.parse import parse
from sgimd_torch.runs.program import command
from sgimd_torch.tasks import goals as goals_of_tasks

ROOT = Path(__file__).parents[2]
ALONE = ("README.md", "CONTRIBUTING.md")  # each block by itself
HOW_TO = tuple(
    f"docs/{name}.md"
    for name in ("own-robot", "reading-runs", "own-demonstrations", "teaching-by-hand", "own-teacher", "asking")
)
SLOW = (  # many runs, the rod's physics, or torch
    "docs/tutorial.md",
    *(f"docs/how-to/{name}.md" for name in ("ablations", "forward-model", "mujoco", "own-network", "sim-to-real")),
)
PAGES = [
    *ALONE,
    "CHANGELOG.md",
    "SECURITY.md",
    "experiments/README.md",
    "sgimd_torch/data/README.md",
    *(path.relative_to(ROOT).as_posix() for path in sorted((ROOT / "docs").rglob("*.md"))),
]
# How-to pages are read one after the other in one folder; here with less to do: seconds, not minutes.
SMALLER = {
    "--movements 300 --name reach": "--movements 40 --repeats 0 --name reach",
    "--goals 0.5,0.5 0.7,0.2": "--goals 0.5,0.5",
    "--movements 500": "--movements 60 --repeats 0",
    "--movements 800": "--movements 80",
    "--movements 1000": "--movements 300",
    "--movements 2000": "--movements 110 --repeats 0",
    "--seeds 0-4": "--seeds 0",
    "--seeds 2000-2001": "--seeds 2000",
    "--tiles 100": "--tiles 20",
}


class Block(NamedTuple):
    """A fenced block: the page and line where its text begins, the words after the fence, its text."""

    page: str
    line: int
    kind: str
    name: str
    text: str

    def __str__(self):
        return f"{self.page}:{self.line}"

    def carry_out(self, names=None):
        """In the working directory; ``names`` are known from blocks above."""
        if self.name:
            Path(self.name).write_text(self.text, encoding="utf-8")
        elif self.kind == "python":
            exec(
                compile("\n" * (self.line - 1) + self.text, ROOT / self.page, "exec"),
                {"__name__": "__main__"} if names is None else names,
            )
        elif self.kind == "sh":
            for line in self.lines():
                program, *words = shlex.split(line, comments=True)
                if program == "python":
                    runpy.run_path(words[0], run_name="__main__")
                else:
                    assert (program, command(_call, words)) == ("sgimd", 0), f"{self}: {line}"

    def told(self):
        """Numbers with which comments behind a print begin."""
        return re.findall(r"^ *print\(.*\)  # (-?\d[\d.]*)", self.text, re.MULTILINE)

    def lines(self):
        """Each command as one line."""
        return [line for line in self.text.replace("\\\n", " ").splitlines() if line.strip()]


def blocks(page, *kinds):
    text = (ROOT / page).read_text(encoding="utf-8")
    for match in re.finditer(r"^```(\w*) ?(.*)\n((?s:.*?))^```$", text, re.MULTILINE):
        kind, name, body = match.groups()
        if kind in kinds:
            yield Block(page, text.count("\n", 0, match.start(3)) + 1, kind, name, body)


# Pages with code that are read in a folder of their own.
ELSEWHERE = ("docs/explained/house.md",)  # tests/project/test_rooms.py
OTHERS = [
    page for page in PAGES if page not in (*ALONE, *HOW_TO, *ELSEWHERE) and any(blocks(page, "python", "sh", "xml"))
]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The working directory, from which modules can be imported, and are forgotten afterwards."""
    before = set(sys.modules)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(goals_of_tasks, "MAX_GOALS", 40)
    yield tmp_path
    for name in set(sys.modules) - before:
        if (getattr(sys.modules[name], "__file__", None) or "").startswith(str(tmp_path)):
            del sys.modules[name]


@pytest.mark.parametrize("block", [block for page in ALONE for block in blocks(page, "python", "sh")], ids=str)
def test_a_block_works_on_its_own_and_prints_what_it_says(block, folder, capsys):
    block.carry_out()
    assert not list(folder.iterdir()), "an example leaves files behind"
    assert {*block.told()} <= {*capsys.readouterr().out.split()}


@pytest.mark.slow
def test_how_to_pages_work_one_after_the_other(folder):
    for page in HOW_TO:
        work_through(page)


@pytest.mark.parametrize("page", [pytest.param(page, marks=[pytest.mark.slow] * (page in SLOW)) for page in OTHERS])
def test_a_page_works_from_top_to_bottom(page, folder):
    work_through(page)


def work_through(page):
    names = {"__name__": "__main__"}
    for block in blocks(page, "python", "sh", "xml"):
        for long, short in SMALLER.items():
            block = block._replace(text=block.text.replace(long, short))
        block.carry_out(names)


def test_all_that_is_made_smaller_is_on_a_page():
    texts = "".join((ROOT / page).read_text(encoding="utf-8") for page in PAGES)
    assert not [long for long in SMALLER if long not in texts]


@pytest.mark.parametrize("page", PAGES)
def test_commands_of_a_page_are_understood(page, folder):
    """In a folder without runs they get as far as telling that there are none. Of many seeds, the first is enough."""
    (folder / "mypackage").mkdir()
    (folder / "mypackage" / "toss.py").write_text(f"{MODULE}\nmake = Slider2\n")
    for block in [block for how_to in HOW_TO for block in blocks(how_to, "python") if block.name]:
        block.carry_out()
    for block in blocks(page, ""):
        for line in block.lines():
            call = re.search(r"(?:^|[\s/])sgimd ([a-z]+.*?)(?: \|\| .*)?$", line)
            if call:
                line = re.sub(r"(--seeds \d+)-\d+", r"\1", re.sub(r"\$\{?\w+(:\?)?\}?", "1", call[1]))
                name, *words = shlex.split(line, comments=True)
                understand(name, words)


@pytest.mark.parametrize("page", PAGES)
def test_commands_that_a_page_names_exist(page):
    named = re.findall(r"`sgimd ([a-z]+)", (ROOT / page).read_text(encoding="utf-8"))
    assert {*named} - {"farthest"} <= WORDS["command"].keys()  # of the worked example of a room


def understand(name, words):
    """Read the words of a command up to where it needs what earlier commands would have made."""
    if name == "run":
        parse(words)
    elif name in ("sweep", "paper"):
        assert command(_call, [name, *words, "--dry-run"]) == 0
    elif name == "teach" and not (words and words[0].startswith("runs/")):  # it would serve until Ctrl-C
        importlib.import_module(f"sgimd_torch.{WORDS['command'][name]}").options_of(words)
    elif name == "check":
        assert command(_call, [name, *words]) == 0
    else:  # a parser that refuses words raises SystemExit
        with pytest.raises((ValueError, OSError), match=r"does not exist|there is no|holds no (run|board)|No such"):
            importlib.import_module(f"sgimd_torch.{WORDS['command'][name]}").main(words)


def test_the_readme_and_its_example_are_short_enough_to_read():
    first = next(blocks("README.md", "python"))
    assert first.told()
    assert len([line for line in first.text.splitlines() if line.strip()]) <= 15
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.split()) <= 800
    assert max(map(len, text.splitlines())) <= 120


def test_all_pages_together_can_be_read():
    pages = [
        path
        for path in ROOT.rglob("*.md")
        if not {".venv", ".others", ".pytest_cache", "site", "build"} & set(path.relative_to(ROOT).parts)
    ]
    assert sum(len(path.read_text(encoding="utf-8").split()) for path in pages) <= 30_000


def test_the_version_to_cite_is_that_of_the_package():
    cited = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {sgimd_torch.__version__}\n" in cited
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.findall(r"^## \[(.*)\]$", changes, re.MULTILINE)[0] == sgimd_torch.__version__


def names_of(text):
    """Names that a program imports from the package, with their modules."""
    found = re.findall(r"^ *from (sgimd_torch[\w.]*) import (\([^)]*\)|[^\n#]*)", text, re.MULTILINE)
    return {(module, name) for module, names in found for name in re.findall(r"\w+", names)}


def test_pages_use_only_public_names():
    (public,) = blocks("docs/names.md", "python")
    public = names_of(public.text) | {("sgimd_torch", name) for name in sgimd_torch.__all__}
    used = {*()}.union(*(names_of(block.text) for page in PAGES for block in blocks(page, "python")))
    assert used <= public
