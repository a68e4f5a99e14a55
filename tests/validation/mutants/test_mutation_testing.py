"""Mutation testing: sites are found, mutants are applied and reverted, killed and surviving mutants are distinguished,
and the page agrees."""

import subprocess
import textwrap
from collections import Counter
from pathlib import Path

import pytest

from validation.mutants import mutation_testing
from validation.mutants.mutant_sites import drawn, sites
from validation.mutants.mutant_trials import Copy, nearest_tests
from validation.mutants.named_mutants import NAMED

ROOT = Path(__file__).resolve().parents[3]
SOURCE = """
    def inside(x: int | None, size):
        \"\"\"Not x < size.\"\"\"
        if x is None:
            raise ValueError("x < 0")
        first, second = -x + 1, x.sum(axis=0)
        check(x)
        return 0 <= x < size and max(first, second)
"""


def changes(source):
    return [(site.kind, site.before, site.after) for site in sites("a.py", source.encode())]


def test_places_are_those_where_people_err():
    found = Counter(changes(textwrap.dedent(SOURCE)))
    assert found == Counter(
        [
            ("comparison", "is", "is not"),
            ("check", 'raise ValueError("x < 0")', "pass"),
            ("axes", "first, second", "second, first"),
            ("sign", "-", ""),
            ("sign", "+", "-"),
            ("bound", "1", "2"),
            ("axes", "0", "1"),
            ("call", "check(x)", "pass"),
            ("logic", "and", "or"),
            ("comparison", "<=", "<"),
            ("comparison", "<", "<="),
            ("bound", "0", "1"),
            ("extreme", "max", "min"),
        ]
    )


@pytest.mark.parametrize(
    "source", ["é = 'ü'; y = a < b", "y = (a\n     < b)", "y = a.T @ arctan2(p, q)", "y = not (a + b).T, -(a), ~a"]
)
def test_a_mistake_changes_its_place_alone_and_is_still_python(source):
    for site in sites("a.py", source.encode()):
        wrong = site.applied(source.encode()).decode()
        compile(wrong, "a.py", "exec")
        assert wrong != source
        assert source.encode()[: site.start] == wrong.encode()[: site.start]
        with pytest.raises(ValueError, match="has changed"):
            site.applied(b"# " + source.encode())


def test_equal_lines_are_told_apart_and_other_lines_do_not_move_the_draw(tmp_path):
    (tmp_path / "optics").mkdir()
    module = tmp_path / "optics" / "a.py"
    module.write_text("y = a < b\ny = a < b\nz = c + d\n")
    before = {site.change for site in drawn(tmp_path, "optics", 2, seed=3)}
    assert len({site.change for site in drawn(tmp_path, "optics", 9, seed=3)}) == 3
    module.write_text("# a comment\ny = a < b\ny = a < b\nz = c + d\n")
    assert {site.change for site in drawn(tmp_path, "optics", 2, seed=3)} == before


def test_named_mutants_can_still_be_made():
    for mutant in NAMED:
        site = mutant.site(ROOT)
        compile(site.applied((ROOT / site.path).read_bytes()), site.path, "exec")
        assert nearest_tests(ROOT, site.path)


@pytest.fixture
def copy(tmp_path):
    """A separate tree with a module, and tests that check one of its two lines."""
    root = tmp_path / "root"
    (root / "optics" / "odd").mkdir(parents=True)
    (root / "tests" / "optics" / "odd").mkdir(parents=True)
    (root / "validation" / "mutants").mkdir(parents=True)
    (root / "optics" / "odd" / "a.py").write_text("def more(x):\n    return x + 1\n\n\nunseen = 1 + 2\n")
    for folder in ("optics", "optics/odd", "tests", "tests/optics", "validation", "validation/mutants"):
        (root / folder / "__init__.py").write_text("")
    (root / "tests" / "optics" / "odd" / "__init__.py").write_text('"""Which covers which.\n\na: test_a.py\n"""\n')
    seen = "from optics.odd.a import more\n\n\ndef test_it():\n    assert more(1) == 2\n\n\n"
    red = "def test_red():\n    assert False\n"
    (root / "tests" / "optics" / "odd" / "test_a.py").write_text(seen + red)
    plugin = "validation/mutants/mutant_plugin.py"
    (root / plugin).write_text((ROOT / plugin).read_text())
    subprocess.run(["git", "init", "-q"], cwd=root, check=True)
    return root, Copy.from_root(root, tmp_path / "work")


def test_killed_and_surviving_are_told_apart_and_the_tree_is_mended(copy):
    """A test that fails without any mutation does not count as killing a mutant."""
    root, tree = copy
    source = (root / "optics/odd/a.py").read_bytes()
    plus, _, unseen, _ = sites("optics/odd/a.py", source)
    files = nearest_tests(root, "optics/odd/a.py")
    assert files == ["tests/optics/odd/test_a.py"]
    killed, survived = tree.tried(plus, files), tree.tried(unseen, files)
    assert (killed.verdict, killed.by) == ("killed", "tests/optics/odd/test_a.py::test_it")
    assert (survived.verdict, survived.by) == ("survived", "")
    assert (tree.tree / "optics/odd/a.py").read_bytes() == (root / "optics/odd/a.py").read_bytes() == source


def test_the_stored_trials_hold_and_are_on_the_page():
    rows = mutation_testing.stored(ROOT / mutation_testing.STORED)
    assert len(rows) >= 195
    assert {row.package for row in rows} == set(mutation_testing.PACKAGES)
    assert mutation_testing.broken(rows) == []
    assert (ROOT / "docs" / "validation" / "mutation_testing.md").read_text() == mutation_testing.page(rows).markdown
    survivors = [mutation_testing.replace(row, verdict="survived", by="", reason="") for row in rows]
    assert len(mutation_testing.broken(survivors)) == len(rows) + 1
