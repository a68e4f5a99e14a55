"""Text reaches a page through a single function that escapes it, and the page's policy lists everything that a browser
may run.
"""

import ast
import base64
import hashlib
import re
from pathlib import Path

import pytest

import evolve.report
from evolve.report.markup import Html, document, figure, html, joined, json_script, section, style, table
from evolve.report.svg import drawing, inline, label
from tests.evolve.report.reported import HOSTILE, Page

SOURCES = sorted(Path(evolve.report.__file__).parent.glob("*.py"))
SCRIPT = "<img src=x onerror=alert(1)>"
MAKERS = {"markup.py", "svg.py"}  # modules that create Html


def test_whatever_is_filled_in_is_text_unless_it_is_html():
    assert html("<b>{}</b>", SCRIPT).markup == "<b>&lt;img src=x onerror=alert(1)&gt;</b>"
    assert html("<b>{}</b>", html("<i>{}</i>", "<")).markup == "<b><i>&lt;</i></b>"
    assert html('<b title="{}">', '" onclick="x').markup == '<b title="&quot; onclick=&quot;x">'
    assert html("{}", "{}{0}{x}").markup == "{}{0}{x}", "values are not templates"
    for pieces in ((), ("a", "b")):
        with pytest.raises(ValueError, match="template has 1 placeholders"):
            html("<b>{}</b>", *pieces)


def test_every_part_of_a_page_escapes_what_it_is_given():
    parts = [
        figure(html("<i>drawn</i>"), html("{}", HOSTILE), HOSTILE),
        section(HOSTILE, HOSTILE, html("<p>text</p>")),
        table([HOSTILE, "b"], [[HOSTILE, html("<code>{}</code>", HOSTILE)]], HOSTILE),
        json_script({HOSTILE: HOSTILE}, HOSTILE),
    ]
    page = Page(document(HOSTILE, joined(parts)).decode())
    assert page.tags["script"] == 1
    assert not page.tags.keys() & {"img", "td></table"}
    assert page.texts["all"].count(HOSTILE) == 6  # title, caption, section's title, a heading and two cells
    assert not [name for _, name, _ in page.attributes if name.startswith("on")]


def test_text_that_utf8_or_html_cannot_hold_is_replaced():
    content = document("\ud800 \x00 \x1b[31m", html("<p>{}</p>", "caf\udce9\x08")).decode()
    assert "<title>? \ufffd \ufffd[31m</title>" in content
    assert "<p>caf?\ufffd</p>" in content


def test_html_is_made_from_templates_that_stand_in_the_code():
    """Otherwise a string built at run time would pass as markup."""
    for path in SOURCES:
        for call in (node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)):
            name = call.func.id if isinstance(call.func, ast.Name) else ""
            template = call.args[0] if call.args else None
            if name == "html":
                assert isinstance(template, ast.Constant) or path.name in MAKERS, (path.name, call.lineno)
            assert name != "Html" or path.name in MAKERS or template is None, (path.name, call.lineno)


def hashes(contents):
    return {f"'sha256-{base64.b64encode(hashlib.sha256(c.encode()).digest()).decode()}'" for c in contents}


def directives(content):
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', content)[1]
    return {part.split()[0]: set(part.split()[1:]) for part in policy.split(";")}


def test_policy_names_style_and_scripts_by_their_hashes_and_allows_nothing_else(content, page):
    allowed = directives(content)
    styles, scripts = (re.findall(f"<{tag}>(.*?)</{tag}>", content, re.DOTALL) for tag in ("style", "script"))
    assert (len(styles), len(scripts)) == (1, 2)
    assert allowed == {
        "default-src": {"'none'"},
        "img-src": {"data:"},
        "base-uri": {"'none'"},
        "form-action": {"'none'"},
        "style-src": hashes(styles),
        "script-src": hashes(scripts),
    }
    assert not [name for _, name, _ in page.attributes if name == "style" or name.startswith("on")]
    assert directives(document("still", Html()).decode())["script-src"] == {"'none'"}


def test_every_look_is_in_the_style_sheet(content, page):
    looks = {value for _, name, value in page.attributes if name == "data-look"}
    assert looks
    assert looks == set(re.findall(r'\[data-look="([^"]*)"\]\{', content))


@pytest.mark.parametrize("declarations", ["a:b}", "a:b{", "</style>", "@import x", "a:\\62", "a:b/*", "a:\n"])
def test_look_is_no_way_into_the_style_sheet(declarations):
    with pytest.raises(ValueError, match="must be CSS declarations"):
        style(declarations)


def test_names_from_outside_are_no_formulas_and_no_markup_in_figures():
    name = '$\\frac$ <b style="x"> \x1b \udcff _'
    with drawing(300, 80) as drawn:
        drawn.add_subplot().set_title(label(name))
        svg = inline(drawn, "named", name)
    assert "<b" not in svg.markup
    assert "$\\frac$" in svg.markup
    assert len(document("t", svg).decode()) > len(svg.markup), "all of it is UTF-8"
