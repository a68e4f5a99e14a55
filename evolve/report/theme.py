"""Colours of the report: one accent and colours after the palette of Okabe & Ito.

Colour-blind readers can distinguish the colours of this palette. All are dark enough for text on paper (contrast of at
least 4.5, WCAG 2.2, 1.4.3). Every colour has a light and a dark value. Figures are drawn with the light values; `svg`
converts these to CSS variables, so that figures follow the page's theme.
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
WALL = "#59636d"  # walls of a ground plan; on dark pages with the minimum contrast for visibility (3)
ACCENT, VERMILLION, GREEN, PURPLE = "#0072b2", "#b34f00", "#007a59", "#a8467f"

LINES = (PURPLE, ACCENT, GREEN, VERMILLION, INK, MUTED)  # colours of a figure's lines, in this order

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
