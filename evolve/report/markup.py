"""Safe HTML. All text is added to a page through `html`, which escapes everything except Html objects.

The template of `html` is a constant in the code; all other strings are inserted into it, and are escaped. As a second
protection, each page has a content security policy with the hashes of its scripts and styles. The browser ignores all
other scripts and styles.
"""

from __future__ import annotations

import base64
import hashlib
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib import resources
from typing import Any

__all__ = [
    "Html",
    "asset",
    "contents",
    "document",
    "duration",
    "exact",
    "figure",
    "html",
    "joined",
    "json_script",
    "key",
    "rounded",
    "section",
    "style",
    "table",
]

_CONTROLS = dict.fromkeys((*range(9), 11, 12, *range(14, 32), 127), "\ufffd")  # characters that HTML forbids
_SLOT = "{}"


@dataclass(frozen=True)
class Html:
    """A piece of a page.

    Other modules, except `svg`, must create nonempty pieces only with functions of this module, such as `html`.

    markup: the HTML text
    rules: CSS declarations for elements of this piece; a key is the value of the attribute `data-look` of those
        elements to which the declarations apply
    """

    markup: str = ""
    rules: Mapping[str, str] = field(default_factory=dict)

    def __add__(self, other: Html) -> Html:
        return Html(self.markup + other.markup, {**self.rules, **other.rules})

    def __bool__(self) -> bool:
        return bool(self.markup)


def html(template: str, *pieces: object) -> Html:
    """Return a template with its placeholders "{}" replaced by the pieces, in order.

    Html objects are inserted unchanged, and all other pieces as escaped text.

    Raises:
        ValueError: the number of pieces differs from the number of placeholders.
    """
    literal = template.split(_SLOT)
    if len(literal) != len(pieces) + 1:
        raise ValueError(f"html: template has {len(literal) - 1} placeholders, got {len(pieces)} pieces")
    filled = [piece if isinstance(piece, Html) else Html(_escaped(piece)) for piece in pieces]
    markup = literal[0] + "".join(piece.markup + rest for piece, rest in zip(filled, literal[1:], strict=True))
    return Html(markup, {name: rule for piece in filled for name, rule in piece.rules.items()})


def joined(pieces: Iterable[Html]) -> Html:
    """Return one piece that contains all pieces in sequence."""
    listed = list(pieces)
    return html(_SLOT * len(listed), *listed)


def style(declarations: str) -> Html:
    """Return an attribute that applies CSS declarations, such as "width:5px", to its element.

    The page's content security policy does not allow the attribute `style`. The attribute `data-look` refers to a rule
    in the page's style sheet instead.

    Raises:
        ValueError: the text contains characters that could end the declarations, such as braces, or that could begin a
            comment.
    """
    if re.search(r"[{}<>@\\\x00-\x1f]|/\*", declarations):
        raise ValueError(f"declarations = {declarations!r}: must be CSS declarations")
    name = hashlib.sha256(declarations.encode()).hexdigest()[:10]
    return Html(f'data-look="{name}"', {name: declarations})


def key(kind: str) -> Html:
    """Return a short coloured stroke for a legend, in the colour of the CSS class `kind`."""
    return html('<span class="key {}" aria-hidden="true"></span>', kind)


def rounded(value: float, digits: int = 3) -> str:
    """Return a number with `digits` significant digits, a typographic minus sign and no exponent.

    A number with more digits before the decimal point is rounded to an integer. For NaN and infinity, the result is an
    en dash.
    """
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    rounded = float(f"{value:.{digits}g}")  # 9.999 rounds to 10.0, which has one more digit
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(rounded))))
    return f"{value:,.{decimals}f}".replace(",", " ").replace("-", "−")


def duration(seconds: float) -> str:
    """Return a duration as text.

    The unit is seconds below two minutes, minutes below two hours, hours below two days, and days from then on.
    """
    for unit, name in ((86400, "days"), (3600, "h"), (60, "min")):
        if seconds >= 2 * unit:
            return f"{rounded(seconds / unit, 2)} {name}"
    return f"{rounded(seconds, 2)} s"


def exact(value: float) -> str:
    """Return a number as text, with at most six significant digits.

    They suffice for settings, and for integers below a million.
    """
    return f"{value:g}".replace("-", "−")


def table(
    header: Sequence[str | Html],
    rows: Iterable[Sequence[str | Html]],
    name: str,
    highlight: int | None = None,
    ids: Sequence[str] = (),
) -> Html:
    """Return a table that can be scrolled sideways.

    header, rows: cells of the first row, and of the other rows; texts are escaped
    name: id of the table
    highlight: number of the emphasised row in `rows`, counted from 0; None: no row
    ids: id of each row; (): no ids
    """
    head = joined(html('<th scope="col">{}</th>', cell) for cell in header)
    body = joined(
        html(
            "<tr{}{}>{}</tr>\n",
            html(" class=best") if i == highlight else Html(),
            html(' id="{}"', ids[i]) if ids else Html(),
            joined(html("<td>{}</td>", cell) for cell in row),
        )
        for i, row in enumerate(rows)
    )
    return html(
        '<div class="scroll" tabindex="0" role="region" aria-label="{}"><table id="{}">\n'
        "<thead><tr>{}</tr></thead>\n<tbody>\n{}</tbody></table></div>\n",
        *(name, name, head, body),
    )


def figure(content: Html, caption: Html, kind: str = "") -> Html:
    """Return a figure with its caption.

    kind: CSS class of the figure
    """
    return html('<figure class="{}">{}<figcaption>{}</figcaption></figure>\n', kind, content, caption)


def section(name: str, title: str, content: Html) -> Html:
    return html('<section id="{}"><h2>{}</h2>\n{}</section>\n', name, title, content)


def contents(page: Html) -> Html:
    """Return links to a page's sections."""
    found = re.findall(r'<section id="([^"]+)"><h2>([^<]*)</h2>', page.markup)
    links = joined(html('<a href="#{}">{}</a> ', Html(name), Html(title)) for name, title in found)
    return html('<nav class="contents" aria-label="Contents">{}</nav>\n', links)


def json_script(value: Any, kind: str) -> Html:
    """Return an element that contains JSON data for a script. "<" is escaped, so that the data cannot end the element.

    kind: CSS class of the element
    """
    encoded = json.dumps(value, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return html('<script type="application/json" class="{}">{}</script>', kind, Html(encoded))


def asset(name: str) -> str:
    """Return the text of a style sheet or script in this module's folder."""
    return resources.files("evolve.report").joinpath(name).read_text(encoding="utf-8")


def document(title: str, body: Html, scripts: Sequence[str] = ()) -> bytes:
    """Return a complete, self-contained page, encoded as UTF-8.

    The content security policy of the page allows only its own styles and scripts, and images in data URIs.

    scripts: names of the files with scripts, in this module's folder
    """
    from evolve.report.theme import CSS

    looks = "".join(f'[data-look="{name}"]{{{rule}}}\n' for name, rule in sorted(body.rules.items()))
    style, programs = f"\n{CSS}{asset('style.css')}{looks}", [f"\n{asset(name)}" for name in scripts]
    page = html(
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta http-equiv="Content-Security-Policy" content="{}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        "<title>{}</title>\n<style>{}</style>\n</head>\n<body>\n{}{}</body>\n</html>\n",
        Html(_policy([style], programs)),
        *(title, Html(style), body, joined(html("<script>{}</script>\n", Html(program)) for program in programs)),
    )
    return page.markup.encode()


def _policy(styles: Sequence[str], scripts: Sequence[str]) -> str:
    """Return a content security policy that allows only these styles and scripts, and images in data URIs."""
    return (
        f"default-src 'none'; img-src data:; base-uri 'none'; form-action 'none'; "
        f"style-src {_hashes(styles)}; script-src {_hashes(scripts)}"
    )


def _hashes(contents: Sequence[str]) -> str:
    digests = (hashlib.sha256(content.encode()).digest() for content in contents)
    return " ".join(f"'sha256-{base64.b64encode(digest).decode()}'" for digest in digests) or "'none'"


def _escaped(value: object) -> str:
    """Return text that is escaped for elements and quoted attributes.

    Characters that UTF-8 or HTML does not allow are replaced.
    """
    whole = str(value).encode("utf-8", "replace").decode()
    return escape(whole.translate(_CONTROLS), quote=True)
