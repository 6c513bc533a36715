"""The pages in results/ and the README's section of results: templates with tables and numbers made from the rows.

Each page is a template in experiments/pages/, which has the text. Change the template, not the page. The rows are those
of results.csv in --results, which compare.py writes, and of the small tables beside it. Intervals are bootstrapped with
a fixed seed, so the same rows give the same pages. What a page lacks is named.

Examples:
  python experiments/claims.py                                  all pages, and the README
  python experiments/claims.py --only RESULTS                   one of them
  python experiments/claims.py --results mine --out mine        of rows of your own, into a folder of your own
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
    from pages import Prose, Tables
    from sgimd_torch.files import make_folder, write_text
    from table import ResultsError

README: Final = "README"
TEMPLATES: Final = Path(__file__).with_name("pages")
PAGES: Final = sorted(path.name.partition(".")[0] for path in TEMPLATES.glob("*.md.j2"))
MADE: Final = "<!-- Made by experiments/claims.py"
BEGIN, END = "<!-- results: made by experiments/claims.py from experiments/pages/README.md.j2 -->", "<!-- end -->"


def filled(name: str, found: Evidence, folder: Path) -> tuple[str, Tables]:
    """The text of a template with its tables and numbers, and the tables, which know what is missing."""
    loader = jinja2.FileSystemLoader(TEMPLATES)
    environment = jinja2.Environment(loader=loader, undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    tables = Tables(found, folder)
    template = environment.get_template(f"{name}.md.j2")
    return template.render(tables=tables, the=Prose(found), claimed=claimed), tables


def into_readme(text: str, section: str) -> str:
    """A README with its section of results made again.

    Raises:
        ResultsError: it has no such section.
    """
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ResultsError(f"the README must have a section from {BEGIN} to {END}; was it edited?")
    return f"{before}{BEGIN}\n{section}{END}{after}"


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
    readme = "whose section of results is made again (default: README.md, with the pages in results/)"
    parser.add_argument("--readme", type=Path, help=readme)
    options = parser.parse_args(argv)
    if options.readme is None and options.out == results:
        options.readme = Path("README.md")
    names = [name for name in PAGES if options.only in (None, name) and (name != README or options.readme)]
    paths = {name: options.readme if name == README else options.out / f"{name}.md" for name in names}
    for name in {*names} - {README}:
        _check_place(paths[name])
    found, texts = Evidence.of(options.results), dict[Path, str]()
    for name in names:
        text, tables = filled(name, found, options.results)
        if name == README:
            text = into_readme(options.readme.read_text(encoding="utf-8"), text)
        else:
            text = f"{MADE} from experiments/pages/{name}.md.j2; change that file, not this one. -->\n\n{text}"
        texts[paths[name]] = text
        verdicts = [each.verdict for each in tables.verdicts]
        print(
            f"{name}: {', '.join(f'{verdicts.count(each)} {each}' for each in dict.fromkeys(verdicts)) or 'no claims'}"
        )
        if tables.missing:
            say(f"{name}: not run: {'; '.join(dict.fromkeys(tables.missing))}")
    make_folder(options.out)
    for path, text in texts.items():
        write_text(path, text)
    return 0


if __name__ == "__main__":
    sys.exit(command(main))
