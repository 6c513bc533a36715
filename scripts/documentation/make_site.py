"""Builds the documentation: the pages of the repository, and an API page for each folder of the library.

    scripts/docs            into site/, which can be opened from the disk
    scripts/docs --serve    and shows it at an address of this machine, where the search works, too

The pages are copied as they lie in the repository, with the files that they link to. So one link serves both a code
host and the site. Where a page links to a source file of the library, the site leads to the API page about it.
"""

from __future__ import annotations

import argparse
import http.server
import importlib
import json
import os
import posixpath
import re
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

from notebooks import as_page

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
PACKAGE = "sgimd_torch"
PAGES = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md", f"{PACKAGE}/data/README.md")
FOLDERS = ("docs", "results")
LINK = re.compile(r"(!?\[[^\]]*\]\()([^)\s#]*)(#[^)\s]*)?(\))")
INTERVAL = re.compile(r"(\[[+−-]?[\d.]+), ([+−-]?[\d.]+\])")  # stays on one line, also in a narrow column
NOTEBOOKS = '["docs/notebooks/"]'  # in zensical.toml, in the place of all of them
COLOUR = re.compile(r"\x1b\[[\d;]*m")
SAVED_AS = re.compile(r"^```(\w+) ([\w./-]+)$", re.MULTILINE)  # as test_readme.py reads the first line of a block


def sources() -> list[str]:
    """The Markdown pages of the repository that are part of the site, as paths from its root."""
    found = [path.relative_to(ROOT).as_posix() for folder in FOLDERS for path in (ROOT / folder).rglob("*.md")]
    return sorted([*PAGES, *found])


def rooms() -> dict[str, list[str]]:
    """API page -> dotted names of its modules: a page for each folder of the library, and for each file beside them."""
    found: dict[str, list[str]] = {}
    for path in sorted((ROOT / PACKAGE).rglob("*.py"), key=lambda path: (path.name != "__init__.py", path)):
        parts = path.relative_to(ROOT).with_suffix("").parts
        folder, module = parts[:-1], ".".join(parts).removesuffix(".__init__")
        # What the package itself offers by name has the first page; its other files have pages of their own.
        page = module if len(folder) == 1 else ".".join(folder)
        found.setdefault(page.removeprefix(f"{PACKAGE}."), []).append(module)
    return dict(sorted(found.items()))


def copy_pages(to: Path) -> None:
    """The pages with what they link to, changed where the site needs something else than a code host."""
    for name in sources():
        text = (ROOT / name).read_text(encoding="utf-8")
        text = INTERVAL.sub("\\1,\N{NO-BREAK SPACE}\\2", SAVED_AS.sub(r'```\1 title="\2"', text))
        place = to / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(LINK.sub(partial(_link, name, to), text), encoding="utf-8")


def copy_notebooks(to: Path) -> list[str]:
    """The notebooks as pages, with the figures that they keep; returns the paths of these pages."""
    made = []
    index = (ROOT / "docs" / "README.md").read_text(encoding="utf-8")  # they come in its order
    for notebook in sorted((ROOT / "docs").rglob("*.ipynb"), key=lambda path: index.find(path.name)):
        page = to / notebook.relative_to(ROOT).with_suffix(".md")
        page.parent.mkdir(parents=True, exist_ok=True)
        text, name = as_page(notebook, page.parent), notebook.relative_to(ROOT).as_posix()
        page.write_text(LINK.sub(partial(_link, name, to), text), encoding="utf-8")
        made.append(page.relative_to(to).as_posix())
    return made


def _link(page: str, to: Path, found: re.Match[str]) -> str:
    """The same link; the file that it leads to is copied if it is no page."""
    before, target, anchor, after = found.groups()
    path = posixpath.normpath(posixpath.join(posixpath.dirname(page), target))
    if not target or "://" in target or not (ROOT / path).is_file():
        return found[0]
    if path.startswith(f"{PACKAGE}/") and path.endswith(".py"):
        module = path.removesuffix(".py").replace("/", ".").removesuffix(".__init__")
        (room,) = [room for room, modules in rooms().items() if module in modules]
        up = posixpath.relpath(f"api/{room}.md", posixpath.dirname(page) or ".")
        return f"{before}{up}#{module}{after}"
    if path.endswith(".ipynb"):
        return f"{before}{target.removesuffix('.ipynb')}.md{anchor or ''}{after}"
    if path not in sources():
        (to / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / path, to / path)
    return f"{before}{target}{anchor or ''}{after}"


def write_api(to: Path) -> None:
    """An API page for each room; what a page shows comes from the docstrings, by mkdocstrings."""
    to.mkdir(parents=True)
    for room, modules in rooms().items():
        title = "the command sgimd" if room == "__main__" else room
        first = f"---\ntitle: {title}\n---\n\n::: {modules[0]}\n    options:\n      heading_level: 1"
        text = "\n\n".join([first, *(f"::: {module}" for module in modules[1:])])
        if room == PACKAGE:
            text += f"\n\n## What `from {PACKAGE} import` offers\n\n{front_door()}"
        (to / f"{room}.md").write_text(f"{text}\n", encoding="utf-8")


def front_door() -> str:
    """A table of the names that can be imported from the package itself, with where they are explained."""
    package = importlib.import_module(PACKAGE)
    rows = ["| name | what it is |", "| --- | --- |"]
    for name in sorted(package.__all__, key=str.lower):
        thing = getattr(package, name)
        if name != "__version__":
            explained = re.sub(r":\w+:(?=`)", "", " ".join((thing.__doc__ or "").split()))
            first = re.split(r"(?<=[.?])(?<!eq\.)(?<!eqs\.)\s", explained, maxsplit=1)[0]
            first = re.sub(r"([][|])", r"\\\1", first)  # a link and a border otherwise
            rows.append(f"| [`{name}`][{thing.__module__}.{name}] | {first} |")
    return "\n".join(rows)


def build(out: Path) -> None:
    """Make the site at ``out``, in the place of an earlier one.

    Raises:
        FileExistsError: something else lies there.
        ValueError: a page has a fault, such as a link that leads nowhere; what the builder says about it.
    """
    if out.exists() and not (out / "objects.inv").exists():
        raise FileExistsError(f"{out} exists and is no site of these pages; move it away")
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        copy_pages(place / "pages")
        write_api(place / "pages" / "api")
        notebooks = copy_notebooks(place / "pages")
        shutil.copy(HERE / "site.css", place / "pages")
        config = (HERE / "zensical.toml").read_text(encoding="utf-8")
        (place / "zensical.toml").write_text(config.replace(NOTEBOOKS, json.dumps(notebooks)), encoding="utf-8")
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(HERE)])}
        command = [sys.executable, "-m", "zensical", "build", "--strict"]
        done = subprocess.run(command, cwd=place, env=environment, capture_output=True, text=True)
        if done.returncode:
            said = done.stdout + done.stderr.partition("Traceback (most recent call last)")[0]
            raise ValueError(COLOUR.sub("", said).strip())
        if out.exists():
            shutil.rmtree(out)
        shutil.move(place / "site", out)


@contextmanager
def serve_in_background(site: Path, port: int = 0) -> Iterator[str]:
    """The address of this machine at which a site is shown; port 0 takes a free one."""
    handler = partial(_Quiet, directory=str(site))
    with http.server.ThreadingHTTPServer(("127.0.0.1", port), handler) as server:
        serving = threading.Thread(target=server.serve_forever)
        serving.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/"
        finally:
            server.shutdown()
            serving.join()


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *args: object) -> None:
        """No line for each file."""


def main(arguments: list[str] | None = None) -> int:
    """The exit code: 1 if the pages have a fault."""
    parser = argparse.ArgumentParser(
        prog="scripts/docs", description="Installs what is missing and builds the documentation into site/, offline."
    )
    parser.add_argument("--out", type=Path, default=ROOT / "site", help="folder of the site (default: site/)")
    parser.add_argument("--serve", action="store_true", help="then show it at an address of this machine, until Ctrl-C")
    parser.add_argument("--port", type=int, default=8000, help="of that address; 0 takes a free one (default: 8000)")
    options = parser.parse_args(arguments)
    print(f"scripts/docs: building {options.out}, which takes half a minute", flush=True)
    try:
        build(options.out)
    except FileExistsError as error:
        print(f"scripts/docs: {error}", file=sys.stderr)
        return 2
    except ValueError as error:
        print(f"{error}\nscripts/docs: the pages have these faults; the earlier site stays as it was", file=sys.stderr)
        return 1
    print(f"scripts/docs: open {options.out / 'index.html'}; with --serve the search works, too")
    if options.serve:
        with suppress(KeyboardInterrupt), serve_in_background(options.out, options.port) as address:
            print(f"scripts/docs: or {address}; Ctrl-C ends it", flush=True)
            threading.Event().wait()
    return 0


if __name__ == "__main__":
    sys.exit(main())
