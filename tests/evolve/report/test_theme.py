"""The theme: every colour in a figure becomes one of the page's colours, in light and dark mode."""

import re

from evolve.report.svg import drawing, inline
from evolve.report.theme import ACCENT, CSS, LINES, VARIABLES


def test_every_colour_has_a_light_and_a_dark_value():
    names = re.findall(r"var\(--(\w+)\)", str(VARIABLES))
    values = {name: re.findall(rf"--{name}:(#[0-9a-f]{{6}})", CSS) for name in names}
    assert len(values) == len(VARIABLES) > 5
    for light, dark, printed in values.values():
        assert light == printed != dark
        assert light in VARIABLES


def test_figures_are_drawn_in_the_pages_colours():
    with drawing(100, 80) as figure:
        figure.add_subplot().plot([0, 1], [1, 0], color=ACCENT)
    drawn = inline(figure, "line", "a line that falls")
    looks = " ".join(drawn.rules.values())
    assert VARIABLES[ACCENT] in looks
    assert not set(VARIABLES) & set(re.findall("#[0-9a-f]{6}", drawn.markup + looks))
    assert set(re.findall('data-look="([^"]*)"', drawn.markup)) == set(drawn.rules)
    assert 'aria-label="a line that falls"' in drawn.markup


def luminance(colour):
    """Return the relative luminance (WCAG 2.2)."""
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one, other):
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def test_text_can_be_read_in_light_and_in_dark():
    """The contrast is at least 4.5 (WCAG 2.2, 1.4.3), which the palette's own green and vermillion do not reach."""
    values = {name: re.findall(rf"--{name}:(#[0-9a-f]{{6}})", CSS)[:2] for name in VARIABLES_BY_NAME}
    for name in ("ink", "muted", "accent", "vermillion", "green", "purple"):
        for background in ("paper", "panel"):
            for text, behind in zip(values[name], values[background], strict=True):
                assert contrast(text, behind) >= 4.5, (name, background)
    for wall, behind in zip(values["wall"], values["panel"], strict=True):  # 1.4.11: other elements than text
        assert contrast(wall, behind) >= 3
    assert contrast("#009e73", "#fefefe") < 4.5
    assert contrast("#000000", "#ffffff") == 21


def test_lines_are_of_the_theme_so_that_none_vanishes_in_the_dark():
    assert set(LINES) <= set(VARIABLES)
    assert len(set(LINES)) == len(LINES) == 6


VARIABLES_BY_NAME = [value.removeprefix("var(--").removesuffix(")") for value in VARIABLES.values()]
