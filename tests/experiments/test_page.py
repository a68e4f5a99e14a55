"""Pages of results: templates are filled in completely, and every value has a place."""

import re
from pathlib import Path

import pytest

from experiments import five_eyes, page
from experiments.page import Figure, Page
from experiments.store import Origin

RESULTS = Path(__file__).parents[2] / "docs/results"
TEMPLATE = "# Title\n\nIt is $size m.\n\n![Sizes](figures/sizes.png)\n\n$command\n\n$origin\n"


@pytest.fixture(autouse=True)
def templates(tmp_path, monkeypatch):
    monkeypatch.setattr(page, "TEMPLATES", tmp_path)
    (tmp_path / "sizes.md").write_text(TEMPLATE, encoding="utf-8")


def sizes(values=None, figure="sizes"):
    values = {"size": "3"} if values is None else values
    return Page("sizes", "make sizes", values, [Figure(figure, lambda path: path.touch())], Origin.here(1.0))


def test_page_is_its_template_filled_in():
    origin = sizes().origin.sentence()
    assert sizes().markdown == f"# Title\n\nIt is 3 m.\n\n![Sizes](figures/sizes.png)\n\nmake sizes\n\n{origin}\n"


def test_what_the_template_lacks_is_refused():
    with pytest.raises(ValueError, match="no place for weight"):
        assert sizes({"size": "3", "weight": "4"}).markdown
    with pytest.raises(ValueError, match="no place for weights"):
        assert sizes(figure="weights").markdown


def test_what_the_page_lacks_is_refused():
    with pytest.raises(KeyError, match="size"):
        assert sizes({}).markdown


def test_published_page_stands_beside_its_figures(tmp_path):
    sizes().publish(tmp_path / "docs")
    assert (tmp_path / "docs/sizes.md").read_text(encoding="utf-8") == sizes().markdown
    assert (tmp_path / "docs/figures/sizes.png").exists()


def test_five_eyes_says_what_its_template_says(monkeypatch):
    """The page's numbers come from renderings that are not stored, so the comparison leaves out the numbers and their
    origin."""
    monkeypatch.undo()
    view = five_eyes.View(None, None, 1.0, 1.0, 1.0, 1.0)
    made = five_eyes.page([view] * len(five_eyes.STAGES), view, Origin.here(1.0)).markdown
    stored = (RESULTS / "five_eyes.md").read_text(encoding="utf-8")
    assert without_numbers(made) == without_numbers(stored)


def without_numbers(markdown):
    return re.sub(r"-?\d+(\.\d+)?(e-?\d+)?", "#", markdown.rpartition("Made in")[0])
