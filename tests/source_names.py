"""Names that our source defines, found without running it: modules, their names, members of classes, and every word in
use.

`missing(text)` lists names that a document mentions and that do not exist. It checks

- paths under our folders, anywhere in the text, and file names that end in .py in code spans;
- modules and their names that begin with one of our packages (`optics.methods.hankel`), anywhere in the text;
- in code spans: members of our classes (`Eye.kernel`), members of modules by their last name
  (`lighting.spawn_bounce_ray`), settings (`search.rungs`), and single words that look like code (with parentheses for a
  call, with an underscore, or in mixed case).

Fenced commands and code are left out, because other tests run them.
"""

from __future__ import annotations

import ast
import builtins
import re
from collections import defaultdict
from functools import lru_cache

from evolve.config.assemble import GENE_FIELDS, SETTINGS
from tests.sources import ROOT
from tests.sources import tree as parsed

PACKAGES = ("optics", "sim", "evolve", "validation", "experiments", "tests")
FOLDERS = (*PACKAGES, "docs", "examples")
GENERATED = ("validation/figures",)
TABLES = ("_CONTENTS", "_HOME")  # tables of contents of packages that load lazily
LIBRARIES = {"dr", "drjit", "gymnasium", "mi", "mitsuba", "mujoco", "np", "numpy", "rhabdom", "torch"}

SHELL_AND_CODE = re.compile(r"```(?:sh|python|toml)\n.*?```", re.DOTALL)
LINK_TARGET = re.compile(r"\]\([^)\s]*\)")
SPAN = re.compile(r"`([^`\n]+)`")
PATH = re.compile(r"(?<![\w./<-])[\w.*-]+(?:/[\w.*-]+)+")
OURS = re.compile(rf"(?<![\w./-])(?:{'|'.join(PACKAGES)})(?:\.[A-Za-z_]\w*)+")
DOTTED = re.compile(r"(?<![\w./\"'-])([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)(\(?)")
CODE_WORD = re.compile(r"\w+_\w+|[A-Z]\w*[a-z]\w*")
WORDS_IN = {
    kind: [field for field in ("id", "attr", "arg", "name", "module", "asname") if field in kind._fields]
    for kind in vars(ast).values()
    if isinstance(kind, type) and issubclass(kind, ast.AST)
}
FILE = re.compile(r"[\w-]+\.(?:csv|exr|html|json|jsonl|md|npz|png|rrd|safetensors|toml|yml)")


def missing(text: str) -> list[str]:
    """Names and paths that the document mentions but that do not exist."""
    prose = LINK_TARGET.sub("]", SHELL_AND_CODE.sub("", text))
    wrong = {path for path in PATH.findall(prose) if path.split("/")[0] in FOLDERS and not path_exists(path)}
    wrong |= {name for name in OURS.findall(PATH.sub("", prose)) if not name_exists(name)}
    for span in SPAN.findall(prose):
        wrong |= {path for path in PATH.findall(span) if path.endswith(".py") and not path_exists(path)}
        for word, called in DOTTED.findall(FILE.sub("", PATH.sub("", span))):
            if word.endswith(".py"):
                known = path_exists(word)
            elif "." in word:
                known = name_exists(word)
            else:
                known = word in words() or not (called or CODE_WORD.fullmatch(word))
            wrong |= set() if known else {word}
    return sorted(wrong)


def path_exists(path: str) -> bool:
    """Return whether a path exists.

    It is a path from the repository's root, which may contain wildcards, or the end of a Python file's path.
    """
    path = path.rstrip(".")
    if path.startswith(GENERATED):
        return True
    return any(ROOT.glob(path)) or (path.endswith(".py") and any(f"/{path}" in f"/{name}" for name in python_files()))


def name_exists(name: str) -> bool:
    """Return whether a dotted name exists.

    It starts with one of our packages, with a class, module or variable, or with a section of a run's settings.
    """
    head, attribute = name.split(".")[:2]
    if head in PACKAGES:
        return _resolves(name)
    if head in LIBRARIES or name in words():
        return True
    if head == "genome":
        return name.split(".")[-1] in GENE_FIELDS
    known = [members(head)] if head in classes() else []
    known += [{setting.split(".")[1] for setting in SETTINGS if setting.startswith(f"{head}.")}]
    if head.islower():
        known += [members(name) for name in classes() if name.lower() == head]
        for module in modules():
            if module.split(".")[-1] == head:
                known += [names_of(module), *(members(name) for name in names_of(module) & classes().keys())]
    if any(known):
        return any(attribute in names for names in known)
    if head[0].isupper():
        return head in words()  # a class of another library, used in our source
    return set(name.split(".")[1:]) <= words()


def _resolves(name: str) -> bool:
    """Return whether a name consists of modules, a name in the last module, and possibly a member of this class."""
    module, rest = name, []
    while module not in modules():
        module, _, last = module.rpartition(".")
        rest.insert(0, last)
    if not rest:
        return True
    if rest[0] not in names_of(module):
        return False
    return len(rest) == 1 or rest[0] not in classes() or rest[1] in members(rest[0])


@lru_cache
def python_files() -> list[str]:
    return [path.relative_to(ROOT).as_posix() for package in PACKAGES for path in (ROOT / package).rglob("*.py")]


@lru_cache
def modules() -> dict[str, ast.Module]:
    """Return the syntax tree of each module, by its dotted name."""
    found = {package: ast.Module([], []) for package in PACKAGES}
    for path in python_files():
        module = path.removesuffix(".py").replace("/", ".").removesuffix(".__init__")
        found[module] = parsed(ROOT / path)
    return found


@lru_cache
def names_of(module: str) -> set[str]:
    """Names that a module defines or imports, and modules in a package."""
    found = {name.split(".")[-1] for name in modules() if name.rpartition(".")[0] == module}
    for node in modules()[module].body:
        found |= _defined(node)
        if isinstance(node, ast.Assign | ast.AnnAssign) and _defined(node) & set(TABLES):
            found |= set(ast.literal_eval(node.value))
        if isinstance(node, ast.Import | ast.ImportFrom):
            found |= {alias.asname or alias.name for alias in node.names}
    return found


@lru_cache
def classes_and_words() -> tuple[dict[str, list[ast.ClassDef]], set[str]]:
    """Class definitions by name, and all words in code outside the tests, both from one walk through all sources."""
    classes, words = defaultdict(list), set()
    for module, tree in modules().items():
        is_test = module.split(".")[0] == "tests"
        for node in ast.walk(tree):
            kind = type(node)
            if kind is ast.ClassDef:
                classes[node.name].append(node)
            if is_test:
                continue
            for field in WORDS_IN.get(kind, ()):
                words.add(getattr(node, field) or "")
            if kind is ast.Constant and isinstance(node.value, str) and len(node.value) < 40:
                words.add(node.value)
    return dict(classes), words


def classes() -> dict[str, list[ast.ClassDef]]:
    return classes_and_words()[0]


@lru_cache
def members(name: str) -> set[str]:
    """Methods and attributes of all classes with this name, and of their base classes in this project."""
    found: set[str] = set()
    for definition in classes().get(name, []):
        for node in definition.body:
            found |= _defined(node)
        for node in ast.walk(definition):
            if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
                found.add(node.attr)
        for base in definition.bases:
            found |= members(ast.unparse(base).split(".")[-1])
    return found


def _defined(node: ast.stmt) -> set[str]:
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return {node.name}
    if isinstance(node, ast.AnnAssign):
        return {ast.unparse(node.target)}
    if isinstance(node, ast.Assign):
        return {name.id for target in node.targets for name in ast.walk(target) if isinstance(name, ast.Name)}
    return set()


@lru_cache
def words() -> set[str]:
    """Every name, argument, attribute and string that may be a key, in all code outside the tests."""
    found = set(dir(builtins)) | set(SETTINGS) | {setting.split(".")[-1] for setting in SETTINGS} | set(GENE_FIELDS)
    found |= set(re.findall(r"[A-Z]+(?:_[A-Z]+)+", (ROOT / "with-env").read_text(encoding="utf-8")))
    found |= classes_and_words()[1]
    return found | {part for name in found for part in name.split(".") if name.replace(".", "").isidentifier()}
