"""A user task in a run's settings: named, hashed, and never executed by code that only reads the run."""

from pathlib import Path

import pytest

from evolve.config.assemble import assemble, from_text, to_toml
from evolve.config.run_config import ConfigError
from evolve.config.task_code import TaskCode

BALL = Path(__file__).parents[3] / "examples" / "find_ball.py"
NAMED = f"{BALL}:FindBall"


@pytest.fixture
def trap(tmp_path):
    """Return a task whose text leaves a mark when it is executed."""
    file = tmp_path / "trap.py"
    file.write_text(f"open({str(tmp_path / 'executed')!r}, 'w')\nclass Trap:\n    pass\n")
    return file


def test_a_config_names_file_class_and_hash_and_no_path():
    config = assemble(NAMED, "quick")
    written = to_toml(config)
    assert (config.task, config.task_name) == ("find_ball.py:FindBall", "FindBall")
    assert f'task_sha256 = "{TaskCode.read(NAMED).sha256}"' in written
    assert str(BALL.parent) not in written
    again = from_text(written)
    assert again == config
    assert again.code is None
    assert again.with_code(NAMED).choice.named_code.text == BALL.read_text()


def test_nothing_is_executed_unless_it_is_named(trap, tmp_path):
    config = from_text(to_toml(assemble(f"{trap}:Trap", "quick")))
    with pytest.raises(ConfigError, match=r"runs only if you name it: add --task trap\.py:Trap"):
        _ = config.choice.named_code
    config.with_code(f"{trap}:Trap")
    assert not (tmp_path / "executed").exists()


def test_another_text_is_another_task(trap):
    config = from_text(to_toml(assemble(f"{trap}:Trap", "quick")))
    trap.write_text(trap.read_text() + "# one remark more\n")
    with pytest.raises(ConfigError, match=r"trap\.py has changed since the run began"):
        config.with_code(f"{trap}:Trap")


def test_line_ends_are_no_change(trap):
    config = assemble(f"{trap}:Trap", "quick")
    trap.write_bytes(trap.read_bytes().replace(b"\n", b"\r\n"))
    assert config.with_code(f"{trap}:Trap").choice.named_code.sha256 == config.task_sha256


def test_files_of_settings_name_no_code(trap, tmp_path):
    file = tmp_path / "settings.toml"
    file.write_text(to_toml(assemble(f"{trap}:Trap", "quick")))
    with pytest.raises(ConfigError, match="a file cannot name code"):
        assemble(file=file)
    with pytest.raises(ConfigError, match="a file cannot name code"):
        assemble("detection", assignments=["task=trap.py:Trap"])
    assert assemble(NAMED, file=file).task == "find_ball.py:FindBall"


def test_what_only_our_agents_have_is_refused_and_eyes_look_up():
    for setting in ("learning.contact_ramp=100", "learning.first_speed=0.2", "learning.least_return=-5"):
        with pytest.raises(ConfigError, match=r"is for built-in tasks, not for find_ball\.py:FindBall"):
            assemble(NAMED, "quick", assignments=[setting])
    with pytest.raises(ConfigError, match=r"world\.mazes: is for the task maze"):
        assemble(NAMED, "quick", assignments=["world.mazes=2"])
    with pytest.raises(ConfigError, match=r"genome\.elevation_deg: is for user tasks"):
        assemble("detection", "quick", assignments=["genome.elevation_deg.open=true"])
    assert "elevation_deg" not in assemble("detection", assignments=["genome.morphological.open=true"]).genome
    assert assemble(NAMED, assignments=["genome.elevation_deg.open=true"]).genome["elevation_deg"].open


@pytest.mark.parametrize(
    ("named", "words"),
    [
        ("nowhere.py:Task", r"nowhere\.py cannot be read \(No such file or directory\)"),
        (f"{BALL}:FindBal", r"did you mean 'FindBall'\?"),
        (f"{BALL}", r"must be FILE\.py:CLASS, a class of .*: it has FindBall"),
    ],
)
def test_names_that_name_nothing(named, words):
    with pytest.raises(ConfigError, match=words):
        assemble(named, "quick")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"class Broken(:\n", r"broken\.py, line 1: invalid syntax"),
        (b"\xff\xfe", r"broken\.py: is not UTF-8 text"),
        (b"x = '\0'\n", r"broken\.py"),
        (b"", "it has none"),
    ],
)
def test_files_that_are_no_python(text, words, tmp_path):
    (tmp_path / "broken.py").write_bytes(text)
    with pytest.raises(ConfigError, match=words) as caught:
        assemble(f"{tmp_path / 'broken.py'}:Broken", "quick")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("digest", ["", "abc", "g" * 64])
def test_a_config_without_its_hash_is_refused(digest):
    written = to_toml(assemble(NAMED, "quick"))
    damaged = written.replace(assemble(NAMED, "quick").task_sha256, digest)
    with pytest.raises(ConfigError, match="task_sha256"):
        from_text(damaged)
