"""Proofs are listed in proofs.toml, in tables of contents, and in the index of their pages."""

import ast
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROOFS = tomllib.loads((ROOT / "validation/proofs.toml").read_text())["proofs"]
FOLDERS = sorted({path.parent for path in (ROOT / "validation").rglob("*.py")})
PAGES = ROOT / "docs/validation"


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.relative_to(ROOT).as_posix())
def test_a_folder_lists_its_modules(folder):
    text = ast.get_docstring(ast.parse((folder / "__init__.py").read_text())) or ""
    there = {path.stem for path in folder.glob("*.py")} | {path.parent.name for path in folder.glob("*/__init__.py")}
    assert there - {"__init__"} <= set(re.findall(r"\w+", text))


def test_pages_and_their_index_follow_the_names_of_proofs():
    names = {path.rpartition("/")[2] for path in PROOFS}
    index = (PAGES / "index.md").read_text()
    listed = re.findall(r"^\| .(\w+)[\]`].*\| ([A-F]\d)? ?\|$", index, re.MULTILINE)
    assert dict(listed) == {path.rpartition("/")[2]: old.partition("_")[0] for path, old in PROOFS.items()}
    assert {page.stem for page in PAGES.glob("*.md")} <= {*names, "index"}
    assert {table.stem for table in PAGES.glob("data/*.csv")} <= names


def test_whatever_writes_a_page_is_a_proof():
    writers = {path for path in (ROOT / "validation").rglob("*.py") if re.search(r'\bPage\("', path.read_text())}
    assert writers == {
        ROOT / f"validation/{path}.py" for path in PROOFS if (PAGES / f"{Path(path).name}.md").is_file()
    } - {
        ROOT / "validation/peers/work_precision.py"  # its page is written by hand
    }
