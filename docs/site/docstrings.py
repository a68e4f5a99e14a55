"""Docstrings for the reference: lines that explain an argument or field become items of a list.

Two forms are known, each at the start of a paragraph or right after such a line:

    radius, height: what they mean,        task     what it means,
        and more of it                              and more of it
"""

from __future__ import annotations

import re
from typing import Any

import griffe

NAMES = r"(?P<names>[a-z_]\w*(?:, [a-z_]\w*)*)"
EXPLAINS = re.compile(rf"(?:{NAMES}: |{NAMES.replace('names', 'column')} {{2,}})(?P<text>\S.*)$")


class Docstrings(griffe.Extension):
    """Rewrites every docstring before it is parsed."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        if obj.docstring:
            obj.docstring.value = with_lists(obj.docstring.value)


def with_lists(text: str) -> str:
    """The docstring with its explanations as Markdown lists."""
    return "\n\n".join(_paragraph(paragraph) for paragraph in re.split(r"\n\s*\n", text))


def _paragraph(text: str) -> str:
    lines: list[str] = []
    listing = False
    for index, line in enumerate(text.split("\n")):
        item = EXPLAINS.match(line)
        if item and (index == 0 or listing):
            names = ", ".join(f"`{name}`" for name in (item["names"] or item["column"]).split(", "))
            lines.append(f"- {names}: {item['text']}")
            listing = True
        else:
            if listing and line[:1].isupper() and lines[-1].endswith("."):  # what is said of all of them
                lines.append("")
                listing = False
            lines.append(f"    {line.strip()}" if listing else line)
    return "\n".join(lines)
