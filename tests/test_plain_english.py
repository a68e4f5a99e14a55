"""Prose is plain English: few markers of dialect, and docstrings whose summaries have a subject or an imperative."""

import ast
from collections import defaultdict

import pytest

from tests.plain_english import ROOT, Text, document, rate, texts, texts_in

MOST, MOST_PER_PAGE = 2.0, 4.0  # markers per 1,000 words; comparison pages of other projects have 0.1 to 0.7
SHORT = 60  # words: one marker in a shorter page says nothing
FRAGMENTS = {
    "And",
    "As",
    "At",
    "Beside",
    "But",
    "By",
    "Everything",
    "From",
    "How",
    "If",
    "In",
    "Nothing",
    "Of",
    "On",
    "Or",
}
FRAGMENTS |= {"So", "That", "Those", "To", "What", "When", "Where", "Whether", "Which", "Who", "Whose", "Why", "With"}


@pytest.fixture(scope="module")
def found():
    return texts()


@pytest.mark.parametrize("kind", ["document", "docstring", "comment", "message"])
def test_markers_are_rare(kind, found):
    mine = [text for text in found if text.kind == kind]
    assert rate(mine) <= MOST


def test_no_page_is_in_dialect(found):
    pages = [text for text in found if text.kind == "document" and text.words >= SHORT]
    assert {page.path.name: rate([page]) for page in pages if rate([page]) > MOST_PER_PAGE} == {}


def test_docstrings_begin_with_a_subject_or_an_imperative(found):
    wrong = defaultdict(list)
    for text in found:
        if text.kind == "docstring" and text.text.split()[0].strip(",.:") in FRAGMENTS:
            wrong[text.path.relative_to(ROOT).as_posix()].append(text.text.split("\n")[0])
    assert wrong == {}


@pytest.mark.parametrize(
    ("text", "markers"),
    [
        ("What eyes report is held against rays anew.", ["anew", "held against", "What ... is"]),
        ("It errs by .05, which is no more than nobody asked for.", ["nobody", "err by", "asked for", "no zero"]),
        ("The eyes' signals agree with traced rays within 0.05.", []),
    ],
)
def test_markers_are_found(text, markers, tmp_path):
    (tmp_path / "page.md").write_text(f"{text}\n\n```text\nanew .05\n```\n\n| anew |\n\n`anew` [page](anew.md)\n")
    names = {name for name, _ in document(tmp_path / "page.md").markers}
    assert names >= set(markers)
    assert bool(names) == bool(markers)


def test_every_kind_of_text_is_read(tmp_path):
    source = r'''"""Told."""
# anew
raise ValueError(f"told {1} anew")
parser.add_argument("--x", help="nobody")
strings = "# beside", "\"# beside", '# beside', """
"# beside""", "\\"  # told
'''
    ast.parse(source)
    (tmp_path / "module.py").write_text(source)
    kinds = [(text.kind, [name for name, _ in text.markers]) for text in texts_in(tmp_path / "module.py")]
    comments = [markers for kind, markers in kinds if kind == "comment"]
    assert comments == [["anew"], ["told"]], "strings are not comments"
    assert ("message", ["nobody"]) in kinds
    assert ("message", ["anew", "told"]) in kinds
    assert ("docstring", []) in kinds  # a capital: the markers are those of running text


def test_rate_counts_markers_per_thousand_words():
    text = Text("comment", ROOT, 1, "anew " + "word " * 499)
    assert rate([text]) == 2.0
