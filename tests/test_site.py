"""The site is built without warnings, needs no network, and its reference has every public name."""

import importlib
import re
import runpy

import pytest

from tests.test_docs import DOCS, ROOT, run


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The built site. The strict mode fails on broken links and anchors, pages outside the navigation and unknown names
    (with --quiet it would not)."""
    folder = tmp_path_factory.mktemp("site")
    child = run("-m", "mkdocs", "build", "--strict", "--site-dir", folder, cwd=ROOT)
    assert child.returncode == 0, child.stderr
    return folder


@pytest.mark.slow
def test_site_is_whole_and_needs_no_network(site):
    pages = list(site.rglob("*.html"))
    assert len(pages) >= len(list(DOCS.rglob("*.md")))
    for page in pages:
        html = page.read_text()
        loaded = re.findall(r"<(?:link|script|img)\b[^>]*?(?:src|href)=[\"']?(https?:[^\"' >]*)", html)
        assert loaded == [], page.name
        prose = re.sub(r"<(pre|code|script)\b.*?</\1>", "", html, flags=re.DOTALL)
        assert "](" not in prose, f"{page.name}: a link that was not parsed"


@pytest.mark.parametrize(
    ("heading", "title"),
    [
        ("050: Every PSF by Dr.Jit, the first one too", "050: Every PSF by Dr.Jit"),  # the dot does not end a clause
        ("Rendering: from worlds to receptor signals", "Rendering: from worlds to receptor signals"),
        ("050: Worlds. How they move", "050: Worlds"),
    ],
)
def test_menus_have_whole_first_clauses(heading, title, tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"# {heading}\n\nText.\n")
    assert runpy.run_path(str(DOCS / "site" / "navigation.py"))["_title"](page) == title


@pytest.mark.slow
def test_reference_has_every_public_name(site):
    lacking = []
    for package in ("optics", "sim", "evolve"):
        page = (site / "reference" / f"{package}.html").read_text()
        names = importlib.import_module(package).__all__
        lacking += [f"{package}.{public}" for public in names if f'id="{package}.{public}"' not in page]
    assert lacking == []
