"""The theme: every colour that a figure is drawn with becomes one of the page's own, in light and in dark."""

import re

from evolve.report.svg import drawing, inline
from evolve.report.theme import ACCENT, CSS, VARIABLES


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
