"""Pieces of HTML. Whatever comes from a file or a config passes through `text`."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from html import escape
from importlib import resources
from typing import Any

__all__ = ["KEY", "asset", "document", "exact", "figure", "json_script", "rounded", "section", "table", "text"]

# The browser itself refuses anything from outside this file.
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"

KEY = '<span class="key {}" aria-hidden="true"></span>'  # a line of a legend, in the colour of that class


def text(value: object) -> str:
    """Escaped for HTML, in attributes too."""
    return escape(str(value), quote=True)


def rounded(value: float, digits: int = 3) -> str:
    """`digits` significant digits without an exponent, a real minus sign; an en dash for what is no number."""
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    rounded = float(f"{value:.{digits}g}")  # 9.999 has an exponent of 1, once rounded to three digits
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(rounded))))
    return f"{value:,.{decimals}f}".replace(",", " ").replace("-", "−")


def exact(value: float) -> str:
    """A setting or a whole number, with no more digits than it has."""
    return f"{value:g}".replace("-", "−")


def table(header: Sequence[str], rows: Iterable[Sequence[str]], name: str, highlight: int | None = None) -> str:
    """A table that scrolls sideways where it must; cells are HTML already; row `highlight` stands out."""
    head = "".join(f'<th scope="col">{cell}</th>' for cell in header)
    body = "".join(
        f"<tr{' class=best' if i == highlight else ''}>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>\n"
        for i, row in enumerate(rows)
    )
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{text(name)}"><table id="{text(name)}">\n'
        f"<thead><tr>{head}</tr></thead>\n<tbody>\n{body}</tbody></table></div>\n"
    )


def figure(content: str, caption: str, kind: str = "") -> str:
    """A figure with its caption (HTML)."""
    return f'<figure class="{text(kind)}">{content}<figcaption>{caption}</figcaption></figure>\n'


def section(name: str, title: str, content: str) -> str:
    return f'<section id="{text(name)}"><h2>{text(title)}</h2>\n{content}</section>\n'


def json_script(value: Any, kind: str) -> str:
    """Data for a script; "<" cannot end the element early."""
    encoded = json.dumps(value, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return f'<script type="application/json" class="{text(kind)}">{encoded}</script>'


def asset(name: str) -> str:
    """A style sheet or script that lies beside this module."""
    return resources.files("evolve.report").joinpath(name).read_text(encoding="utf-8")


def document(title: str, body: str, scripts: Sequence[str] = ()) -> bytes:
    """A whole page that needs nothing but itself."""
    from evolve.report.theme import CSS

    script = "".join(f"<script>\n{asset(name)}</script>\n" for name in scripts)
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f"<title>{text(title)}</title>\n<style>\n{CSS}{asset('style.css')}</style>\n</head>\n<body>\n"
        f"{body}{script}</body>\n</html>\n"
    ).encode()
