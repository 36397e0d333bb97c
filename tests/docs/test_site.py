"""The documentation site, against every public name and page, and in a browser."""

import functools
import re
import subprocess
import sys
import threading
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from selenium.webdriver.support.ui import WebDriverWait
from sphinx.util.inventory import InventoryFile

from tests.browser import chromium
from tests.public_names import namespaces

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.nightly


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site, its lessons with the outputs that they are kept with."""
    folder = tmp_path_factory.mktemp("site")
    command = ["-m", "sphinx", "-W", "--keep-going", "-q", "-j", "2", "-c", "docs", ".", folder]
    built = subprocess.run(
        [sys.executable, *map(str, command)], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert built.returncode == 0, built.stderr
    assert built.stderr == ""
    return folder


def public_names():
    """All names of the package that are no modules, by the path that a user writes."""
    sys.path.append(str(ROOT / "docs" / "_ext"))
    try:
        from public_names import public_names
    finally:
        sys.path.pop()
    pages = sorted((ROOT / "docs" / "reference").glob("*.rst"))
    modules = ["jaxbiped" if page.stem == "jaxbiped" else f"jaxbiped.{page.stem}" for page in pages]
    return {f"{module}.{name}" for module in modules for name in public_names(module)}


def test_every_public_name_is_in_the_reference(site):
    inventory = InventoryFile.loads((site / "objects.inv").read_bytes(), uri="")
    documented = {
        name for kind, names in inventory.data.items() if kind.startswith("py:") for name in names
    }
    names = public_names()
    assert len(names) > 250
    assert names - documented == set()


def test_every_namespace_has_a_page():
    pages = {page.stem for page in (ROOT / "docs" / "reference").glob("*.rst")}
    assert {name.removeprefix("jb.") for name in namespaces()} | {"jaxbiped"} == pages


def test_lessons_are_on_the_site_with_their_pictures(site):
    for notebook in (ROOT / "notebooks").glob("*.ipynb"):
        page = (site / "notebooks" / f"{notebook.stem}.html").read_text()
        assert "<img" in page, notebook.stem


def test_every_picture_of_the_gallery_leads_to_its_script(site):
    pictures = sorted((ROOT / "docs" / "gallery").glob("*.png"))
    page = (site / "docs" / "gallery.html").read_text()
    assert pictures
    for picture in pictures:
        assert picture.name in page
        assert f"{picture.stem.partition('-')[0]}.py" in page


def test_source_leads_back_to_the_names_that_the_reference_lists(site):
    back = re.compile(r'class="viewcode-back" href="([^"#]+)#([^"]+)"')
    links = [
        ((page.parent / file).resolve(), name)
        for page in site.glob("_modules/jaxbiped/**/*.html")
        for file, name in back.findall(page.read_text())
    ]
    pages = {page: page.read_text() for page, _ in links}
    dead = [name for page, name in links if f'id="{name}"' not in pages[page]]
    assert len(links) > 100
    assert dead == []


def test_mathematics_is_on_the_page_and_nothing_is_loaded_from_a_network(site):
    assert (site / "docs" / "model.html").read_text().count("<math ") > 20
    loaded = r"""<(?:script|link|img|iframe)\b[^>]*\b(?:src|href)=["']?https?://"""
    pages = [*site.rglob("*.html")]
    assert [page.name for page in pages if re.search(loaded, page.read_text())] == []


def test_a_walk_is_played_on_its_page(served, browser):
    browser.resize()
    browser.driver.get(f"{served}/docs/watch.html")
    browser.driver.switch_to.frame(browser.find("iframe"))
    WebDriverWait(browser.driver, 20).until(lambda _: browser.run(PLAYED) > 0.0)


PLAYED = "return Number(document.querySelector('input[type=range]')?.value ?? 0)"
"""Where the first range of the viewer's page stands: its time."""


def test_the_front_door_leads_to_the_index(site):
    assert 'href="docs/index.html"' in (site / "index.html").read_text()


@pytest.mark.parametrize(
    ("sought", "page"),
    [
        ("multiplier", "docs/gaits"),
        ("basin", "docs/basins"),
        ("stiffness", "docs/laws"),
        ("find_gait", "docs/reference/jaxbiped"),
    ],
)
def test_a_search_leads_to_the_right_page(served, browser, sought, page):
    browser.driver.get(f"{served}/search.html?q={sought}")
    said = "return document.querySelector('#search-results .search-summary')?.innerText ?? ''"
    WebDriverWait(browser.driver, 60).until(lambda _: "found" in browser.run(said))
    places = "return [...document.querySelectorAll('#search-results li a')].map(a => a.href)"
    found = [each.removeprefix(f"{served}/").partition(".html")[0] for each in browser.run(places)]
    assert page in found[:8], (browser.run(said), found)


@pytest.fixture(scope="module")
def browser():
    with chromium() as page:
        yield page


@pytest.fixture(scope="module")
def served(site):
    """The site's address, as a host gives it."""
    handler = functools.partial(QuietHandler, directory=str(site))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


class QuietHandler(SimpleHTTPRequestHandler):
    """Serves files without a word."""

    def log_message(self, *_):
        pass


def test_pages_open_without_a_message_on_the_console(served, browser):
    browser.errors()
    for name in ("docs/index", "docs/gallery", "docs/reference/gait", "notebooks/first_walk"):
        browser.resize(width=400)
        browser.driver.get(f"{served}/{name}.html")
        severe = [each["message"] for each in browser.errors() if each["level"] == "SEVERE"]
        assert severe == [], name
        wider = "return document.documentElement.scrollWidth - window.innerWidth"
        assert browser.run(wider) <= 0, name
