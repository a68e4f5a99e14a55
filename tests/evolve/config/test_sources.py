"""Sources of settings: presets and tasks are found by name, and files of one kind are not accepted as the other."""

from dataclasses import asdict
from importlib import resources

import pytest

from evolve.config.assemble import assemble
from evolve.config.run_config import TASKS, ConfigError
from evolve.config.sources import preset_names, read_assignment, task_defaults

FILES = sorted((resources.files("evolve") / "config" / "tasks").iterdir())


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_a_tasks_file_is_what_its_task_sets(file):
    task = file.name.removesuffix(".toml")
    assert task in TASKS
    settings = asdict(assemble(task))
    others = [asdict(assemble("detection", preset)) for preset in (None, "quick")]
    tree = task_defaults(task).tree
    for section in tree.keys() - {"genome"}:
        for name, value in tree[section].items():
            assert settings[section][name] == value
            assert any(other[section][name] != value for other in others), "a default that all tasks share is redundant"
    for gene, uses in tree["genome"].items():
        assert {key: settings["genome"][gene][key] for key in uses} == uses


def test_what_is_no_task_sets_nothing():
    assert FILES
    for name in ("detection", "../../presets/lens", "paper", 3, None):
        assert task_defaults(name).tree == {}


def test_tasks_files_are_no_presets():
    assert "quick" in preset_names()
    assert not set(preset_names()) & set(TASKS)


def test_a_tasks_own_setting_is_blamed_on_nobody():
    with pytest.raises(ConfigError, match=r"low = 1 is not below high = 1$"):
        assemble("navigation", assignments=["genome.resolution_height.open=true"])


@pytest.mark.parametrize(
    ("text", "tree"),
    [
        (" search.population = 8 ", {"search": {"population": 8}}),
        ("genome.fov_deg.open=false", {"genome": {"fov_deg": {"open": False}}}),
        ("eye.receptors=lms", {"eye": {"receptors": "lms"}}),
    ],
)
def test_assignments_are_toml_or_bare_words(text, tree):
    source = read_assignment(text)
    assert source.tree == tree
    assert source.name == f"--set {text.strip()}"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("seed=" + "1" * 5000, "--set seed: "),
        ("seed=" + "[" * 3000, "--set seed: "),
        ("search.population=8\nsearch.generations=3", "must be one setting"),
    ],
)
def test_assignments_that_are_none_are_refused_in_one_line(text, words):
    with pytest.raises(ConfigError, match=words) as caught:
        read_assignment(text)
    assert "\n" not in str(caught.value)
