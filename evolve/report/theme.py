"""Colours of the report: one accent, the rest after Okabe & Ito's palette, which colour-blind readers can tell apart,
dark enough for text on paper (contrast of 4.5 and more, WCAG 2.2, 1.4.3).

Every colour has a light and a dark value. Figures are drawn with the light ones; `svg` turns them into CSS variables,
so that the page's theme reaches into them.
"""

from __future__ import annotations

__all__ = [
    "ACCENT",
    "CSS",
    "GREEN",
    "INK",
    "LINE",
    "LINES",
    "MUTED",
    "PANEL",
    "PAPER",
    "PURPLE",
    "VARIABLES",
    "VERMILLION",
    "WALL",
]

INK, MUTED, LINE, PAPER, PANEL = "#1d2329", "#5c6670", "#d8dde2", "#fefefe", "#f5f6f8"
WALL = "#59636d"  # of a ground plan; where pages are dark no brighter than it takes to be seen (contrast of 3)
ACCENT, VERMILLION, GREEN, PURPLE = "#0072b2", "#b34f00", "#007a59", "#a8467f"

LINES = (PURPLE, ACCENT, GREEN, VERMILLION, INK, MUTED)  # of a figure, one after the other

_DARK = {
    "ink": (INK, "#e4e7ea"),
    "muted": (MUTED, "#9aa5b0"),
    "line": (LINE, "#3a424a"),
    "paper": (PAPER, "#14181c"),
    "panel": (PANEL, "#1d2227"),
    "wall": (WALL, "#66717c"),
    "accent": (ACCENT, "#56b4e9"),
    "vermillion": (VERMILLION, "#f08a4b"),
    "green": (GREEN, "#2fbf94"),
    "purple": (PURPLE, "#d98fbb"),
}

VARIABLES = {light: f"var(--{name})" for name, (light, _) in _DARK.items()}


def _root(column: int) -> str:
    return ":root{" + ";".join(f"--{name}:{values[column]}" for name, values in _DARK.items()) + "}"


CSS = f"{_root(0)}\n@media (prefers-color-scheme: dark){{{_root(1)}}}\n@media print{{{_root(0)}}}\n"
