"""Make the pages in results/ and the README from templates and from the tables of results.

The text of each page is a template in experiments/pages/. Change the template, not the page. --results has the tables
that compare.py writes, results.csv and smaller ones. Intervals are bootstrapped with a fixed seed, so equal tables give
equal pages. The script lists runs that the tables lack.

Examples:
  python experiments/claims.py                  all pages, and the README
  python experiments/claims.py --results mine   pages of your own tables, beside them
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from sgimd_torch.runs.messages import say
from sgimd_torch.runs.program import command
from sgimd_torch.runs.signals import loading

with loading():  # Ctrl-C shows no traceback
    import jinja2

    import claimed
    import robots
    from evidence import Evidence
    from page_tables import Page
    from sgimd_torch.files import write_text
    from table import ResultsError

README: Final = "README"
TEMPLATES: Final = Path(__file__).with_name("pages")
PAGES: Final = sorted(path.name.partition(".")[0] for path in TEMPLATES.glob("*.md.j2"))


def filled(name: str, evidence: Evidence, folder: Path) -> tuple[str, Page]:
    """The text of a template filled with tables and numbers, and the `Page` that has made them."""
    loader = jinja2.FileSystemLoader(TEMPLATES)
    environment = jinja2.Environment(loader=loader, undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    page = Page(evidence, folder)
    return environment.get_template(f"{name}.md.j2").render(page=page, claimed=claimed, robots=robots), page


def main(argv: Sequence[str] | None = None) -> int:
    """Make the pages; if the tables are damaged, the exit code is 2 and no page is changed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    results = Path("results")
    where = "folder of the tables and pages; only with the default, the README changes, too (default: %(default)s)"
    parser.add_argument("--results", type=Path, default=results, help=where)
    options = parser.parse_args(argv)
    if not options.results.is_dir():
        raise ResultsError(f"there is no folder {options.results}; name one in which compare.py has written its tables")
    evidence, texts = Evidence.of(options.results), dict[Path, str]()
    for name in PAGES:
        if name == README and options.results != results:
            continue
        text, page = filled(name, evidence, options.results)
        text = f"<!-- Made by experiments/claims.py; change experiments/pages/{name}.md.j2. -->\n\n{text}"
        texts[(Path() if name == README else options.results) / f"{name}.md"] = text
        if page.missing:
            say(f"{name}: not run: {'; '.join(dict.fromkeys(page.missing))}")
    for path, text in texts.items():
        write_text(path, text)
        print(path)
    return 0


if __name__ == "__main__":
    sys.exit(command(main))
