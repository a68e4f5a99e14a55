"""Terms in the report with a hint: each is in the glossary, and accessible by mouse and keyboard."""

import re
from pathlib import Path

import pytest

from evolve.report.hints import MEANINGS, hint
from evolve.report.markup import asset

GLOSSARY = (Path(__file__).parents[3] / "docs" / "glossary.md").read_text()


def test_every_word_is_in_the_glossary():
    named = set(
        re.split(r"[^\w ]+", " | ".join(line.split("|")[1] for line in GLOSSARY.splitlines() if line[:1] == "|"))
    )
    known = {word.strip() for word in named} | {word.strip() + "s" for word in named}
    assert {word for word in MEANINGS if word not in known} == set()


def test_a_hint_is_said_by_its_element_and_shown_by_the_style_sheet():
    shown = hint("fitness", "Fitness").markup
    assert re.fullmatch(r'<dfn tabindex="0" aria-label="fitness: [^"<>]{20,}">Fitness</dfn>', shown)
    assert hint("signal").markup.endswith(">signal</dfn>")
    style = asset("style.css")
    assert re.search(r"dfn:hover::after,dfn:focus::after\{content:attr\(aria-label\)", style)


def test_words_without_a_meaning_are_no_hints():
    with pytest.raises(KeyError):
        hint("fitnes")
