"""Configuration files of the project's hosting service and tools are well formed and correct."""

import json
import re
import subprocess
from pathlib import Path

import pytest
import yaml

import rhabdom

ROOT = Path(__file__).resolve().parents[2]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_workflows_run_what_there_is(path):
    jobs = yaml.safe_load(path.read_text())["jobs"]
    steps = [step.get("run", "") for job in jobs.values() for step in job["steps"]]
    assert any(steps)
    for script in re.findall(r"\.ci/[\w-]+", "\n".join(steps)):
        assert (ROOT / script).is_file(), script
    for folder in re.findall(r"tests/[\w/]+", "\n".join(steps)):
        assert (ROOT / folder).is_dir(), folder


def test_ci_knows_every_system_and_python_that_are_named():
    jobs = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text())["jobs"]
    matrix = jobs["wheel"]["strategy"]["matrix"]
    declared = re.findall(r"Python :: (3\.\d+)\"", (ROOT / "pyproject.toml").read_text())
    assert matrix["python"] == declared
    systems = " ".join([*matrix["os"], *(job["runs-on"] for job in jobs.values())])
    assert all(system in systems for system in ("ubuntu", "macos", "windows"))


@pytest.mark.parametrize("script", ["run", "first-hour"])
def test_scripts_are_bash(script):
    subprocess.run(["bash", "-n", ROOT / ".ci" / script], check=True)


def test_citation_and_changelog_name_the_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert citation["version"] == rhabdom.__version__
    assert {"cff-version", "message", "title", "authors"} <= citation.keys()
    headings = re.findall(r"^## \[(.+)\]", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert headings[0] == "Unreleased"
    assert rhabdom.__version__ in headings


@pytest.mark.parametrize("path", sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("[bi]*.yml")), ids=lambda p: p.name)
def test_forms_have_what_forms_need(path):
    form = yaml.safe_load(path.read_text())
    assert form["name"]
    assert form["description"]
    ids = [field["id"] for field in form["body"]]
    assert len(ids) == len(set(ids)) > 1
    assert all(field["attributes"]["label"] for field in form["body"])


def test_containers_and_hooks_are_in_their_forms():
    assert json.loads((ROOT / ".devcontainer" / "devcontainer.json").read_text())["postCreateCommand"].startswith(
        "./with-env"
    )
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())["repos"][0]["hooks"]
    assert {"ruff-format", "ruff"} <= {hook["id"] for hook in hooks}
    assert 'ENTRYPOINT ["evolve"]' in (ROOT / "Dockerfile").read_text()


def test_examples_are_numbered_once():
    numbers = [path.name[:2] for path in (ROOT / "examples").glob("[0-9]*.py")]
    assert len(set(numbers)) == len(numbers) > 3
