"""What the documents show is true: code runs and prints what they say, commands exist, links lead somewhere."""

import importlib
import math
import os
import re
import shlex
import subprocess
import sys
import tomllib
from functools import lru_cache
from pathlib import Path

import pytest

from evolve.cli.main import main
from evolve.config.assemble import assemble
from tests.source_names import missing

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
READ_ON_THE_SPOT = [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
DOCUMENTS = [*READ_ON_THE_SPOT, *sorted(DOCS.rglob("*.md"))]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]

# Code, and what it prints where the page shows that.
CODE = re.compile(r"```python\n((?:(?!```).)*)```(?:\n+```text\n((?:(?!```).)*)```)?", re.DOTALL)
NUMBER = re.compile(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?")
END = "\x1e"  # of a block's output


def name(path):
    return path.relative_to(ROOT).as_posix()


def run(*arguments, **options):
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NO_MKDOCS_2_WARNING": "1"}
    return subprocess.run(
        [sys.executable, *arguments], env=environment, capture_output=True, text=True, check=False, **options
    )


# --- the site


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The built site. Strict: broken links and anchors, pages outside the navigation and unknown names fail (with
    --quiet they would not)."""
    folder = tmp_path_factory.mktemp("site")
    child = run("-m", "mkdocs", "build", "--strict", "--site-dir", folder, cwd=ROOT)
    assert child.returncode == 0, child.stderr
    return folder


def test_site_is_whole_and_needs_no_network(site):
    pages = list(site.rglob("*.html"))
    assert len(pages) >= len(list(DOCS.rglob("*.md")))
    for page in pages:
        html = page.read_text()
        loaded = re.findall(r"<(?:link|script|img)\b[^>]*?(?:src|href)=[\"']?(https?:[^\"' >]*)", html)
        assert loaded == [], page.name
        prose = re.sub(r"<(pre|code|script)\b.*?</\1>", "", html, flags=re.DOTALL)
        assert "](" not in prose, f"{page.name}: a link that was not understood"


def test_menus_have_whole_first_clauses(site):
    """Of "Every picture by Dr.Jit, the first one too" the dot ends none."""
    assert re.search(r">\s*050: Every picture by Dr\.Jit\s*<", (site / "decisions" / "index.html").read_text())


@pytest.mark.parametrize("package", ["optics", "sim", "evolve"])
def test_reference_has_every_public_name(package, site):
    page = (site / "reference" / f"{package}.html").read_text()
    for public in importlib.import_module(package).__all__:
        assert f'id="{package}.{public}"' in page, public


@pytest.mark.parametrize("document", READ_ON_THE_SPOT, ids=name)
def test_links_to_files_lead_somewhere(document):
    for target in re.findall(r"\]\(([^)#]+)\)", document.read_text()):
        assert target.startswith("https://") or (document.parent / target).exists(), target


# --- code


AS_A_NOTEBOOK = DOCS / "tutorial" / "python.md"  # tests/evolve/interactive/test_run_from_python.py runs it
SESSIONS = [page for page in DOCUMENTS if CODE.search(page.read_text()) and page != AS_A_NOTEBOOK]


@pytest.mark.parametrize("document", SESSIONS, ids=name)
def test_code_runs_and_prints_what_is_shown(document, tmp_path):
    """All blocks of a page in one session."""
    blocks = CODE.findall(document.read_text())
    session = "".join(f"{code}\nprint({END!r}, flush=True)\n" for code, _ in blocks)
    child = run("-c", session, cwd=tmp_path)
    assert child.returncode == 0, child.stderr
    for (code, shown), printed in zip(blocks, child.stdout.split(f"{END}\n"), strict=False):
        assert not shown or agrees(shown, printed), f"{code}\nprints\n{printed}\ninstead of\n{shown}"


def agrees(shown, printed):
    """Same words; numbers within 5 % or 2e-5 (what is smaller than float32's noise differs between machines)."""
    pairs = zip(NUMBER.findall(shown), NUMBER.findall(printed), strict=False)
    same_words = NUMBER.sub("#", shown).split() == NUMBER.sub("#", printed).split()
    return same_words and all(math.isclose(float(a), float(b), rel_tol=0.05, abs_tol=2e-5) for a, b in pairs)


def test_outputs_that_differ_are_noticed():
    assert agrees("error 2.9e-06 of 12", "error 3.8e-06 of 12.1\n")
    assert not agrees("error 0.12", "error 0.13")
    assert not agrees("error 0.12", "mistake 0.12")
    assert not agrees("1 2", "1 2 3")


@pytest.mark.parametrize("example", sorted((ROOT / "examples").glob("*.py")), ids=lambda path: path.stem)
def test_example_runs(example, tmp_path):
    child = run(example, cwd=tmp_path)
    assert child.returncode == 0, child.stderr
    assert child.stdout.strip()


# --- names


@pytest.mark.parametrize("document", [*DOCUMENTS, ROOT / "CHANGELOG.md"], ids=name)
def test_paths_and_names_exist(document):
    assert missing(document.read_text()) == []


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
        ("`lighting.onwards`, `lighting.backwards`", ["lighting.backwards"]),
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
    """Command lines of the page's shell blocks, comments and ./with-env left out."""
    for block in re.findall(r"```sh\n(.*?)```", document.read_text(), re.DOTALL):
        for line in block.replace("\\\n", " ").splitlines():
            words = shlex.split(line, comments=True)
            yield words[1:] if words[:1] == ["./with-env"] else words


@pytest.mark.parametrize("document", [page for page in DOCUMENTS if "```sh\n" in page.read_text()], ids=name)
def test_commands_exist_with_their_options(document, capsys):
    for program, *arguments in filter(None, commands(document)):
        if program == "evolve":
            check_evolve(arguments, capsys)
        elif program == "python" and arguments[0] == "-m":
            check_options(("-m", arguments[1]), arguments[2:])
        elif program == "python":
            assert (ROOT / arguments[0]).is_file()
            check_options((str(ROOT / arguments[0]),), arguments[1:])
        elif program == "pip":
            for extra in re.findall(r"\.\[(.+)\]", " ".join(arguments)):
                assert set(extra.split(",")) <= set(EXTRAS), extra


def check_evolve(arguments, capsys):
    """The command has these options; the settings of a run are ones."""
    with pytest.raises(SystemExit) as stop:
        main([arguments[0], "--help"])
    assert stop.value.code == 0
    options = {word for word in arguments if word.startswith("--")}
    assert options <= set(re.findall(r"--[a-z][a-z0-9-]*", capsys.readouterr().out)), arguments
    if arguments[0] == "run" and not {"TASK", "NAME"} & set(arguments):
        named = {word: arguments[i + 1] for i, word in enumerate(arguments[:-1]) if word in ("--preset", "--scale")}
        task = None if arguments[1].startswith("--") else arguments[1]
        settings = [arguments[i + 1] for i, word in enumerate(arguments) if word == "--set"]
        assemble(task, named.get("--preset", "paper"), None, settings, scale=named.get("--scale"))


def check_options(program, arguments):
    options = {word for word in arguments if word.startswith("--")}
    assert options <= set(re.findall(r"--[a-z-]+", help_of(program))) if options else True, (program, arguments)


@lru_cache
def help_of(program):
    child = run(*program, "--help", cwd=ROOT)
    assert child.returncode == 0, child.stderr
    return child.stdout


def test_readme_keeps_its_two_commands():
    found = [" ".join(words) for words in commands(ROOT / "README.md")]
    assert found[:2] == ["evolve run detection --preset quick", "pytest -n auto"]
    assert {"run", "status", "resume", "replay", "export", "genes"} <= {
        line.split()[1] for line in found if "evolve " in line
    }
