"""The documentation site: it builds without a network, shows the whole library, and fetches nothing when it is read."""

import contextlib
import importlib
import inspect
import os
import re
import shutil
import subprocess
import sys
import threading
import zlib
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest
from make_site import HERE, ROOT

import sgimd_torch
from browser import chromium

pytestmark = pytest.mark.slow
# of the kinds that differ: front page, text and code, equations, docstrings, wide tables, pictures
LOOKED_AT = (
    *("index.html", "docs/tutorial.html", "docs/explained/method.html", "docs/notebooks/first_learner.html"),
    *("api/sgimd_torch/goals/interest_map.html", "api/sgimd_torch/index.html", "names.html"),
    *("results/RESULTS.html", "results/LEARNING.html", "docs/runs.html"),
)


def without_network():
    """Words before a command that take its network away, if this system lets us."""
    words = ["unshare", "--user", "--map-root-user", "--net"]
    allowed = shutil.which("unshare") and subprocess.run([*words, "true"], capture_output=True).returncode == 0
    return words if allowed else []


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    for library in ("zensical", "mkdocstrings", "l2m4m"):
        pytest.importorskip(library, reason=f"needs {library} of the extra docs, which is not installed")
    out = tmp_path_factory.mktemp("documentation") / "site"
    build = "import sys, pathlib, make_site; sys.exit(make_site.build(pathlib.Path(sys.argv[1])))"
    command = [*without_network(), sys.executable, "-c", build, str(out)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=HERE, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return out


# Addresses that a browser fetches to show a page: those of all elements, except links to other pages.
FETCHED = re.compile(
    r"""<(?!a\s)(?![^>]*\srel=["']?(?:canonical|next|prev)\b)"""
    r"""[^>]*\s(?:src|href|data|poster)=["']?((?:https?:)?//[^"' >]*)"""
)


def test_no_page_asks_for_anything_from_outside(site):
    pages = list(site.rglob("*.html"))
    assert len(pages) > 50
    outside = {page.name: FETCHED.findall(page.read_text(encoding="utf-8")) for page in pages}
    assert not {page: addresses for page, addresses in outside.items() if addresses}
    for sheet in site.rglob("*.css"):
        assert not re.search(r"(url\(|@import)\s*[\"']?(https?:)?//", sheet.read_text(encoding="utf-8")), sheet


def public(module):
    """Dotted names of a module and of everything public in it; of a module whose extra is missing, its name alone."""
    yield module
    with contextlib.suppress(ImportError):
        for name, value in vars(importlib.import_module(module)).items():
            if (inspect.isclass(value) or inspect.isfunction(value)) and value.__module__ == module and name[0] != "_":
                yield f"{module}.{name}"


def test_the_api_pages_have_every_module_and_everything_public_in_it(site):
    # mkdocstrings lists the names that have a place in a file for other projects.
    inventory = zlib.decompress((site / "objects.inv").read_bytes().split(b"\n", 4)[4]).decode()
    explained = {line.split()[0] for line in inventory.splitlines()}
    paths = [path.relative_to(ROOT).with_suffix("") for path in (ROOT / "sgimd_torch").rglob("*.py")]
    wanted = {name for path in paths for name in public(".".join(path.parts).removesuffix(".__init__"))}
    assert not wanted - explained
    front = (site / "names.html").read_text(encoding="utf-8")
    for name in set(sgimd_torch.__all__) - {"__version__"}:
        thing = getattr(sgimd_torch, name)
        place = f"{getattr(thing, 'func', thing).__module__}.{name}"
        assert place in explained, place
        assert f"#{place}" in front, place


def test_docstrings_have_links_and_show_the_use_of_a_module_as_code(site):
    page = (site / "api/sgimd_torch/goals/interest_map.html").read_text(encoding="utf-8")
    intro, _ = page.split('id="sgimd_torch.goals.interest_map.InterestMap"')
    assert 'href="regions.html#sgimd_torch.goals.regions.Tiling"' in intro  # it says `Tiling`
    code = re.sub("<[^>]*>", "", intro[intro.index("<code>", intro.index("<pre>")) :])
    assert "goals = InterestMap(problem)" in code


def test_equations_are_mathml_without_a_command_that_was_not_understood(site):
    page = (site / "docs/explained/method.html").read_text(encoding="utf-8")
    equations = re.findall(r"<math.*?</math>", page, re.DOTALL)
    assert len(equations) > 30
    assert "<mtext>(7)</mtext>" in page
    assert not [equation for equation in equations if "\\" in equation]


@pytest.mark.parametrize("width", [1400, 390])
def test_pages_show_whole_without_a_network(site, width):
    with chromium() as browser:
        context = browser.new_context(viewport={"width": width, "height": 900}, offline=True)
        for name in LOOKED_AT:
            tab, asked = context.new_page(), []
            tab.on("request", lambda request, asked=asked: asked.append(request.url))
            tab.goto(f"file://{site / name}")
            tab.wait_for_load_state("networkidle")
            assert not [address for address in asked if not address.startswith(("file:", "data:", "blob:"))], name
            broken = "[...document.images].filter(image => image.complete && !image.naturalWidth).length"
            assert tab.evaluate(broken) == 0
            wider = tab.evaluate("document.documentElement.scrollWidth - window.innerWidth")
            assert wider <= 0, f"{name} is {wider} pixels wider than the window"
            if "method" in name:
                heights = "math => math.getBoundingClientRect().height"
                sizes = tab.evaluate(f"[...document.querySelectorAll('math')].map({heights})")
                assert len(sizes) > 30
                assert min(sizes) > 5
            tab.close()


@contextlib.contextmanager
def served(site):
    """The address of this machine at which the site is shown."""
    handler = partial(SimpleHTTPRequestHandler, directory=str(site))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


def test_the_search_finds_a_page_when_the_site_is_served(site):
    with chromium() as browser, served(site) as address:
        tab = browser.new_page()
        tab.goto(address)
        tab.wait_for_load_state("networkidle")
        tab.keyboard.press("Control+k")
        tab.keyboard.type("noise floor", delay=20)
        tab.locator("a", has_text="How large is the part of the error").first.wait_for(timeout=60000)
