"""Colours of the report, after the palette of Okabe and Ito, which colour-blind readers can distinguish.

Every colour has a value for light pages and a value for dark pages. The colours of text and curves (INK, MUTED, ACCENT,
VERMILLION, GREEN and PURPLE) are legible on PAPER and PANEL: their contrast is at least 4.5 (WCAG 2.2, 1.4.3). Figures
are drawn with the light values. The module `svg` replaces these by CSS variables, so that figures follow the page's
theme.
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
WALL = "#59636d"  # walls of a ground plan; on dark pages, the contrast is the minimum for visibility (3)
ACCENT, VERMILLION, GREEN, PURPLE = "#0072b2", "#b34f00", "#007a59", "#a8467f"

LINES = (PURPLE, ACCENT, GREEN, VERMILLION, INK, MUTED)  # colours of the lines in a figure, in this order

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
