"""The documents are correct: code runs and prints the output shown, commands exist, and links work."""

import io
import math
import os
import re
import runpy
import shlex
import subprocess
import sys
import tomllib
from contextlib import redirect_stdout
from functools import lru_cache
from importlib import metadata
from pathlib import Path
from unittest import mock

import pytest

from evolve.cli.main import main
from evolve.config.assemble import assemble
from tests.source_names import missing

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
READ_ON_THE_SPOT = [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
DOCUMENTS = [*READ_ON_THE_SPOT, *sorted(DOCS.rglob("*.md"))]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]

# Code, and the output that the page shows for it.
CODE = re.compile(r"```python\n((?:(?!```).)*)```(?:\n+```text\n((?:(?!```).)*)```)?", re.DOTALL)
NUMBER = re.compile(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?")
END = "\x1e"  # end of a block's output


def name(path):
    return path.relative_to(ROOT).as_posix()


def run(*arguments, **options):
    options |= {"env": {**os.environ, "PYTHONPATH": str(ROOT), "NO_MKDOCS_2_WARNING": "1"}}
    return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, check=False, **options)


def test_links_to_files_lead_somewhere():
    targets = [
        (document, target)
        for document in READ_ON_THE_SPOT
        for target in re.findall(r"\]\(([^)#]+)\)", document.read_text())
        if not target.startswith("https://")
    ]
    assert [(name(page), target) for page, target in targets if not (page.parent / target).exists()] == []


# --- code


AS_A_NOTEBOOK = DOCS / "tutorial" / "python.md"  # executed in tests/evolve/interactive/test_run_from_python.py
BLOCKS = {page: CODE.findall(page.read_text()) for page in DOCUMENTS if page != AS_A_NOTEBOOK}
README, START = ([code for code, _ in BLOCKS[page]] for page in (ROOT / "README.md", DOCS / "index.md"))
assert README[: len(START)] == START  # so that the README's session runs the start page's code
SESSIONS = [page for page, blocks in BLOCKS.items() if blocks and page != DOCS / "index.md"]


def code_of(page):
    return "".join(code for code, _ in CODE.findall(page.read_text()))


# Pages whose code needs only optics and three packages. Their sessions can import no other package, except dependencies
# of the three.
MORE = re.compile(r"^ *(?:from rhabdom.*(?:sim|evolve)|(?:import|from) (?:torch|colour|matplotlib)\b)", re.MULTILINE)
OPTICS_ALONE = [page for page in SESSIONS if not MORE.search(code_of(page))]
OTHERS = sorted(set(metadata.packages_distributions()) - {"numpy", "scipy", "drjit", "optics", "rhabdom"})
REFUSE = f"""
import sys
class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {OTHERS!r}:
            raise ModuleNotFoundError(f"refused: {{name}}", name=name)
sys.meta_path.insert(0, Refuse())
"""


@pytest.mark.slow
@pytest.mark.parametrize("document", SESSIONS, ids=name)
def test_code_runs_and_prints_what_is_shown(document, tmp_path):
    """All code blocks of a page run in one session."""
    session = "".join(f"{code}\nprint({END!r}, flush=True)\n" for code, _ in BLOCKS[document])
    child = run("-c", REFUSE + session if document in OPTICS_ALONE else session, cwd=tmp_path)
    assert child.returncode == 0, child.stderr
    for (code, shown), printed in zip(BLOCKS[document], child.stdout.split(f"{END}\n"), strict=False):
        assert not shown or agrees(shown, printed), f"{code}\nprints\n{printed}\ninstead of\n{shown}"


def agrees(shown, printed):
    """Return whether the words are equal, and numbers agree within 5 % or 2e-5.

    float32 noise below 2e-5 differs between machines.
    """
    pairs = zip(NUMBER.findall(shown), NUMBER.findall(printed), strict=False)
    same_words = NUMBER.sub("#", shown).split() == NUMBER.sub("#", printed).split()
    return same_words and all(math.isclose(float(a), float(b), rel_tol=0.05, abs_tol=2e-5) for a, b in pairs)


def test_pages_about_optics_run_on_three_packages():
    assert len(OPTICS_ALONE) > 10
    assert DOCS / "tutorial" / "optics.md" in OPTICS_ALONE
    assert "matplotlib" in OTHERS
    assert "refused: torch" in run("-c", f"{REFUSE}import torch").stderr


def test_outputs_that_differ_are_noticed():
    assert agrees("error 2.9e-06 of 12", "error 3.8e-06 of 12.1\n")
    assert not any(agrees("error 0.12", other) for other in ("error 0.13", "mistake 0.12"))
    assert not agrees("1 2", "1 2 3")


def test_code_imports_the_packages_from_rhabdom():
    """`import optics` imports another project's package if it comes first on Python's path."""
    pages = {name(page): code_of(page) for page in DOCUMENTS}
    pages |= {name(path): path.read_text() for path in (ROOT / "examples").glob("*.py")}
    direct = re.compile(r"^ *(?:import|from) (?:optics|sim|evolve)\b.*", re.MULTILINE)
    assert {page: direct.findall(code) for page, code in pages.items() if direct.search(code)} == {}


# Other tests of optics judge the results of these examples.
SHORT = {
    "08_tolerancing": ("--trials", "1"),
    "09_hologram": ("--steps", "8"),
    "10_extended_depth": ("--steps", "2"),
    "11_lens_through_an_eye": ("--steps", "4"),
}


@pytest.mark.slow
@pytest.mark.parametrize("example", sorted((ROOT / "examples").glob("*.py")), ids=lambda path: path.stem)
def test_example_runs(example, tmp_path):
    child = run(example, *SHORT.get(example.stem, ()), cwd=tmp_path)
    assert child.returncode == 0, child.stderr
    assert child.stdout.strip()


# --- names


def test_paths_and_names_exist():
    wrong = {name(document): missing(document.read_text()) for document in [*DOCUMENTS, ROOT / "CHANGELOG.md"]}
    assert {document: names for document, names in wrong.items() if names} == {}


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("see `optics.methods.hankel` and optics/methods/hankel.py", []),
        ("see `optics.methods.direct_sum`", ["optics.methods.direct_sum"]),
        ("in optics/direct_sum.py", ["optics/direct_sum.py"]),
        ("`textbook_of_optics.py`", ["textbook_of_optics.py"]),
        ("`tests/optics/methods/test_*.py`, `tests/optics/test_no_*.py`", ["tests/optics/test_no_*.py"]),
        ("`python -m validation.optics.psf_error_prediction --cases 9`", []),
        ("    python -m validation.optics.aliassing", ["validation.optics.aliassing"]),
        ("`optics.psf`, `sim.BatchedRenderer(world)`, `optics.torch.PointSpread`", []),
        ("`optics.psff`", ["optics.psff"]),
        ("`sim.Fidelity.light`, `Fidelity.light`, `Eye.kernel`, `Pupil.area`", []),
        ("`sim.Fidelity.lights`, `Fidelity.colour`", ["Fidelity.colour", "sim.Fidelity.lights"]),
        ("`lighting.spawn_bounce_ray`, `lighting.backwards`", ["lighting.backwards"]),
        ("`search.rungs=3`, `search.steps`", ["search.steps"]),
        ("`genome.NAME.opens_at`, `genome.NAME.shuts_at`", ["genome.NAME.shuts_at"]),
        ("`eye.in_bands(x)`, `eye.noise_sigma`, `eye.out_of_bands(x)`", ["eye.out_of_bands"]),
        ("`NodeChoice`, `linear_weights`, `choose_fidelity(world, eyes)`", []),
        ("`Sight`, `lit_in_bands`, `STEEPEST_SINE`", ["STEEPEST_SINE", "Sight", "lit_in_bands"]),
        ("`mirror(model)`, `mirrord(model)`", ["mirrord"]),
        ("`mujoco.Renderer`, `MjData.timer`, `config.toml`, `evolve genes`", []),
        ("[none](validation/none.md), https://host/optics/none.py", []),  # links: see above
    ],
)
def test_names_that_do_not_exist_are_noticed(text, wrong):
    assert missing(text) == wrong


# --- commands


def commands(document):
    """Command lines of the page's shell blocks, without comments and ./with-env."""
    for block in re.findall(r"```sh\n(.*?)```", document.read_text(), re.DOTALL):
        for line in block.replace("\\\n", " ").splitlines():
            words = shlex.split(line, comments=True)
            yield words[1:] if words[:1] == ["./with-env"] else words


@pytest.mark.filterwarnings("ignore:.*found in sys.modules after import:RuntimeWarning")
def test_commands_exist_with_their_options(capsys):
    faults = {}
    for document in DOCUMENTS:
        for words in filter(None, commands(document)):
            if lacking := lacking_of(words, capsys):
                faults[name(document), " ".join(words)] = lacking
    assert faults == {}


def lacking_of(words, capsys):
    """Options of a command line that its program lacks, and other faults."""
    program, *arguments = words
    options = {word for word in arguments if word.startswith("--")}
    if program == "evolve":
        settings_are_ones(arguments)
        return options - options_in(help_of_evolve(arguments[0], capsys))
    if program == "python":
        module = arguments[0] == "-m"
        if not module and not (ROOT / arguments[0]).is_file():
            return {arguments[0]}
        return options and options - options_in(help_of(arguments[module], module))
    if program == "pip":
        extras = re.findall(r"\.\[(.+)\]", " ".join(arguments))
        return {extra for group in extras for extra in group.split(",")} - set(EXTRAS)
    return set()


def options_in(text):
    return set(re.findall(r"--[a-z][a-z0-9-]*", text))


def help_of_evolve(command, capsys):
    with pytest.raises(SystemExit) as stop:
        main([command, "--help"])
    assert stop.value.code == 0
    return capsys.readouterr().out


def settings_are_ones(arguments):
    """Check the settings of a run; unknown ones are refused."""
    if arguments[0] == "run" and not {"TASK", "NAME"} & set(arguments):
        named = {word: arguments[i + 1] for i, word in enumerate(arguments[:-1]) if word in ("--preset", "--scale")}
        task = None if arguments[1].startswith("--") else arguments[1]
        settings = [arguments[i + 1] for i, word in enumerate(arguments) if word == "--set"]
        assemble(task, named.get("--preset", "paper"), None, settings, scale=named.get("--scale"))


@lru_cache
def help_of(program, module):
    """Output of a module or script with --help, run in this process, which has already loaded most of the imports."""
    execute = runpy.run_module if module else runpy.run_path
    with (
        redirect_stdout(io.StringIO()) as printed,
        mock.patch("sys.argv", [program, "--help"]),
        pytest.raises(SystemExit) as stop,
    ):
        execute(program, run_name="__main__")
    assert not stop.value.code, program
    return printed.getvalue()


def test_readme_keeps_its_two_commands():
    found = [" ".join(words) for words in commands(ROOT / "README.md")]
    assert found[:2] == ["evolve run detection --preset quick", "pytest -n auto"]
    assert {"run", "status", "resume", "replay", "export", "genes"} <= {
        line.split()[1] for line in found if "evolve " in line
    }
