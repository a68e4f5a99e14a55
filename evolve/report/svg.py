"""Conversion of Matplotlib figures to SVG elements, which follow the page's light or dark theme.

The module does not use pyplot, whose global state could change a figure. With the same version of Matplotlib, the same
figure gives the same bytes.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from html import unescape
from typing import Any

import matplotlib
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from evolve.report.markup import Html, html, joined, style
from evolve.report.theme import INK, LINE, MUTED, VARIABLES

__all__ = ["drawing", "inline", "label"]

_STYLE = {
    "svg.fonttype": "none",  # text as text elements, which are small, and which readers can select
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": LINE,
    "axes.labelcolor": MUTED,
    "axes.titlecolor": INK,
    "axes.titlelocation": "left",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": LINE,
    "grid.linewidth": 0.6,
    "text.color": INK,
    "xtick.color": LINE,
    "ytick.color": LINE,
    "xtick.labelcolor": MUTED,
    "ytick.labelcolor": MUTED,
    "xtick.major.size": 3,
    "ytick.major.size": 3,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
    "lines.solid_capstyle": "round",
}


@contextmanager
def drawing(width: float, height: float, font: float = 11.0) -> Iterator[Figure]:
    """Create a figure of `width` x `height` SVG units. Within the context, Matplotlib uses the style of the report."""
    sizes = {"font.size": font, "axes.titlesize": font, "axes.labelsize": font, "legend.fontsize": font}
    ticks = {"xtick.labelsize": font - 1, "ytick.labelsize": font - 1}
    with matplotlib.rc_context({**_STYLE, **sizes, **ticks}):
        yield Figure(figsize=(width / 72, height / 72), dpi=72, layout="constrained")


def label(name: str) -> str:
    """Return an untrusted name as a label for Matplotlib.

    "$" is escaped, so that the name is not parsed as a formula, and unprintable characters are replaced.
    """
    plain = "".join(letter if letter.isprintable() else "\ufffd" for letter in name)
    return plain.replace("$", r"\$")


def inline(figure: Figure, name: str, alt: str) -> Html:
    """Return a figure as an <svg> element.

    The page's content security policy does not allow styles in elements. The styles of the figure are therefore moved
    to the page's style sheet.

    name: prefix of the ids in the element, unique on the page
    alt: description of the figure for screen readers
    """
    buffer = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": name, "svg.fonttype": "none"}):
        nothing: dict[str, Any] = {"Date": None, "Creator": None, "Format": None, "Type": None}
        FigureCanvasSVG(figure).print_svg(buffer, metadata=nothing)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    # Matplotlib's style element is removed; its only rule is in style.css.
    text = re.sub(r"<metadata>.*?</metadata>\s*|<!--.*?-->\s*|<style.*?</style>\s*", "", text, flags=re.DOTALL)
    view_box = re.search(r'viewBox="[^"]*"', text)
    assert view_box is not None
    text = re.sub(r"^<svg[^>]*>", "", text)
    text = re.sub("#[0-9a-f]{6}", lambda colour: VARIABLES.get(colour[0], colour[0]), text)
    opening = html('<svg {} role="img" aria-label="{}">', Html(view_box[0]), alt)
    return opening + _without_inline_styles(_with_own_ids(text, name))


def _without_inline_styles(text: str) -> Html:
    """Replace the attributes `style` by `data-look`.

    Text in the figure that has the form of such an attribute is also replaced, because Matplotlib does not escape
    quotes in text.
    """
    pieces = re.split(r' style="([^"]*)"', text)
    return joined(html(" {}", style(unescape(piece))) if at % 2 else Html(piece) for at, piece in enumerate(pieces))


def _with_own_ids(text: str, name: str) -> str:
    """Put the figure's name in front of every id to which the figure itself refers, and remove all other ids.

    Links to targets outside the figure remain unchanged.
    """
    used = set(re.findall(r'(?:url\(#|href="#)([^")]+)', text)) & set(re.findall(r' id="([^"]+)"', text))
    text = re.sub(r' id="([^"]+)"', lambda m: f' id="{name}-{m[1]}"' if m[1] in used else "", text)
    return re.sub(
        r'(url\(#|href="#)([^")]+)', lambda m: f"{m[1]}{name}-{m[2]}" if m[2] in used else f"{m[1]}{m[2]}", text
    )
