"""Make the pages in results/ and the README's section of results: fill templates with tables and numbers of the rows.

The text of each page is a template in experiments/pages/. Change the template, not the page. The rows are in
results.csv and in the small tables beside it, which compare.py writes to --results. Intervals are bootstrapped with a
fixed seed, so the same rows give the same pages. The script names missing rows.

Examples:
  python experiments/claims.py                                  all pages, and the README
  python experiments/claims.py --only RESULTS                   one page
  python experiments/claims.py --results mine --out mine        your own rows, into a folder of your own
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from sgimd_torch.runs.process import command, loading, say

with loading():  # Ctrl-C shows no traceback
    import jinja2

    import claimed
    from evidence import Evidence
    from page_tables import Page
    from sgimd_torch.files import make_folder, write_text
    from table import ResultsError

README: Final = "README"
TEMPLATES: Final = Path(__file__).with_name("pages")
PAGES: Final = sorted(path.name.partition(".")[0] for path in TEMPLATES.glob("*.md.j2"))
MADE: Final = "<!-- Made by experiments/claims.py"
BEGIN, END = "<!-- results: made by experiments/claims.py from experiments/pages/README.md.j2 -->", "<!-- end -->"


def filled(name: str, found: Evidence, folder: Path) -> tuple[str, Page]:
    """The text of a template with its tables and numbers, and the page that has made them."""
    loader = jinja2.FileSystemLoader(TEMPLATES)
    environment = jinja2.Environment(loader=loader, undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    page = Page(found, folder)
    return environment.get_template(f"{name}.md.j2").render(page=page, claimed=claimed), page


def into_readme(text: str, section: str) -> str:
    """A README with its section of results made again.

    Raises:
        ResultsError: the README has no such section.
    """
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ResultsError(f"the README must have a section from {BEGIN} to {END}; was it edited?")
    return f"{before}{BEGIN}\n{section}{END}{after}"


def _check_place(path: Path) -> None:
    """Raise a ResultsError if the file at ``path`` is not one of our pages, so that it is not overwritten."""
    if path.is_file() and not path.read_bytes().startswith(MADE.encode()):
        raise ResultsError(
            f"{path} was not made by claims.py and is left as it is; move it away, or name another --out"
        )


def main(argv: Sequence[str] | None = None) -> int:
    """Make the pages. If the rows make no sense, the exit code is 2 and no page is changed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    results = Path("results")
    parser.add_argument("--results", type=Path, default=results, help="folder of the rows (default: %(default)s)")
    where = "folder of the pages; the README changes only if it is %(default)s (default: %(default)s)"
    parser.add_argument("--out", type=Path, default=results, help=where)
    parser.add_argument("--only", choices=PAGES, help="page to make (default: all)")
    options = parser.parse_args(argv)
    names = [name for name in PAGES if options.only in (None, name) and (name != README or options.out == results)]
    paths = {name: Path("README.md") if name == README else options.out / f"{name}.md" for name in names}
    for name in {*names} - {README}:
        _check_place(paths[name])
    found, texts = Evidence.of(options.results), dict[Path, str]()
    for name in names:
        text, page = filled(name, found, options.results)
        if name == README:
            text = into_readme(paths[name].read_text(encoding="utf-8"), text)
        else:
            text = f"{MADE} from experiments/pages/{name}.md.j2; change that file, not this one. -->\n\n{text}"
        texts[paths[name]] = text
        verdicts = [each.verdict for each in page.verdicts]
        print(
            f"{name}: {', '.join(f'{verdicts.count(each)} {each}' for each in dict.fromkeys(verdicts)) or 'no claims'}"
        )
        if page.missing:
            say(f"{name}: not run: {'; '.join(dict.fromkeys(page.missing))}")
    make_folder(options.out)
    for path, text in texts.items():
        write_text(path, text)
    return 0


if __name__ == "__main__":
    sys.exit(command(main))
