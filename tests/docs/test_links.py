"""Links between the pages lead somewhere, also to the heading that they name, as a code host reads them; the site's
navigation has every page once; what a page quotes of the code stands there."""

import posixpath
import re
import tomllib
from collections import Counter

import pytest
from make_site import COPIED, HERE, ROOT

COPIES = sorted({path.relative_to(ROOT).as_posix() for pattern in COPIED for path in ROOT.glob(pattern)})
PAGES = [*(name for name in COPIES if name.endswith(".md")), "experiments/README.md"]
LINK = re.compile(r"(?<!`)\[[^\]]*\]\(([^)\s]*)\)")
FENCED = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
QUOTE = re.compile(r"^```py (\S+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def text_of(page):
    return (ROOT / page).read_text(encoding="utf-8")


def anchors(page):
    """Of its headings, as code hosts make them: small letters, no punctuation, a dash for each space."""
    headings = re.findall(r"^#{1,6} (.*)$", FENCED.sub("", text_of(page)), re.MULTILINE)
    seen, names = Counter(), set()
    for heading in headings:
        words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower()
        anchor = re.sub(r"[^\w\- ]", "", words).strip().replace(" ", "-")
        names.add(f"{anchor}-{seen[anchor]}" if seen[anchor] else anchor)
        seen[anchor] += 1
    return names


@pytest.mark.parametrize("page", PAGES)
def test_every_link_inside_the_repository_leads_to_a_file_and_a_heading(page):
    lost = []
    for link in LINK.findall(FENCED.sub("", text_of(page))):
        target, _, anchor = link.partition("#")
        if "://" in link or link.startswith("mailto:"):
            continue
        path = posixpath.normpath(posixpath.join(posixpath.dirname(page), target)) if target else page
        if not (ROOT / path).exists() or (anchor and path.endswith(".md") and anchor not in anchors(path)):
            lost.append(link)
    assert not lost


@pytest.mark.parametrize("page", PAGES)
def test_files_that_a_page_names_exist(page):
    paths = re.findall(r"`((?:experiments|scripts|tests|sgimd_torch)/[\w./-]+)`", text_of(page))
    assert not [path for path in paths if not (ROOT / path).exists()]


def test_the_index_names_every_page_of_docs_once():
    listed = re.findall(r"^- \[.*?\]\((.*?)\): ", text_of("docs/README.md"), re.MULTILINE)
    pages = {path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*.md")} - {"README.md"}
    assert sorted(link for link in listed if not link.startswith("../")) == sorted(pages)


def test_the_navigation_has_every_page_once():
    def pages(entry):
        if isinstance(entry, str):
            return [entry]
        return [page for part in (entry.values() if isinstance(entry, dict) else entry) for page in pages(part)]

    listed = pages(tomllib.loads((HERE / "zensical.toml").read_text(encoding="utf-8"))["project"]["nav"])
    made = [re.sub(r"\.ipynb$", ".md", name) for name in COPIES if name.endswith((".md", ".ipynb"))]
    assert sorted(listed) == sorted([*made, "names.md"])


@pytest.mark.parametrize("page", [page for page in PAGES if QUOTE.search(text_of(page))])
def test_what_a_page_quotes_of_the_code_stands_there_in_this_order(page):
    for path, quoted in QUOTE.findall(text_of(page)):
        source = [line.strip() for line in text_of(path).splitlines()]
        for line in quoted.splitlines():
            if line.strip() not in ("", "..."):
                assert line.strip() in source, f"{path} has no such line after the ones before: {line}"
                source = source[source.index(line.strip()) + 1 :]
