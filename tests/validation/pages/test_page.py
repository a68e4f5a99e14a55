"""A page holds its script's docstring and table, and is written whole."""

from validation.pages.page import Page, blanked, parser

PAGE = Page("nothing_at_all", "A title (B9)\n\nProse.\n\n    python -m x\n", "a 1.0e-03\nb 7", [])


def test_page_is_docstring_figure_and_table():
    assert PAGE.markdown == (
        "# A title (B9)\n\nProse.\n\n    python -m x\n\nThe command draws `validation/figures/nothing_at_all.png`.\n\n"
        "```\na 1.0e-03\nb 7\n```\n"
    )


def test_publishing_writes_what_is_asked_and_tells_the_verdict(tmp_path, capsys):
    options = parser("x").parse_args(["--out", str(tmp_path / "figures"), "--docs", str(tmp_path / "docs")])
    drawn = []
    assert PAGE.publish(options, drawn.append) == 0
    assert drawn == [tmp_path / "figures" / "nothing_at_all.png"]
    assert (tmp_path / "docs" / "nothing_at_all.md").read_text(encoding="utf-8") == PAGE.markdown
    assert list((tmp_path / "docs").iterdir()) == [tmp_path / "docs" / "nothing_at_all.md"]
    broken = Page("nothing_at_all", "t", "table", ["it broke"])
    assert broken.publish(parser("x").parse_args(["--out", str(tmp_path)]), drawn.append) == 1
    assert "it broke" in capsys.readouterr().out


def test_numbers_are_blanked_and_words_are_not():
    assert blanked("a 1.0e-03  b") == blanked("a 2e5 b")
    assert blanked("a refused") != blanked("a 1.0e-03")
