"""The command line: invalid input gives one line on stderr and exit code 2, never a traceback, and help appears
quickly.
"""

import json
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from evolve.cli.arguments import EXAMPLES, FIRST, parse
from evolve.cli.main import main
from evolve.config.assemble import assemble, from_toml
from evolve.config.run_config import TASKS
from evolve.config.sources import preset_names
from evolve.genome.genotype import GENES
from rhabdom import __version__

ROOT = Path(__file__).parents[3]

BAD = {
    "unknown command": (("rnu", "detection"), "'rnu'; did you mean 'run'? (see evolve --help)"),
    "unknown flag": (("run", "--prest", "quick"), "'--preset'? (see evolve run --help)"),
    "unknown flag of no command": (("--verison",), "evolve: error: "),
    "unknown argument of two lines": (("demo", "a\nb"), "unrecognized arguments: a b (see evolve demo --help)"),
    "unknown argument of 5,000 letters": (("demo", "x" * 5000), "xx [...] xx"),
    "unknown shell": (("completion", "fsh"), "did you mean 'zsh'?"),
    "loud and quiet": (("run", "detection", "--quiet", "--json"), "--json: not allowed with argument --quiet"),
    "list of nothing": (("list", "/absent"), "/absent: No such file or directory"),
    "unknown task": (("run", "detecton"), "unknown task 'detecton'; did you mean 'detection'?"),
    "unknown preset": (("run", "detection", "--preset", "quik"), "did you mean 'quick'?"),
    "unknown gene": (("run", "detection", "--set", "genome.n_eye.open=false"), "did you mean 'n_eyes'?"),
    "unknown key": (("run", "detection", "--set", "serch.sigma=1"), "did you mean 'search'?"),
    "out of range": (("run", "detection", "--set", "search.population=1"), "must be in [2, 10000]"),
    "wrong type": (("run", "detection", "--seed", "one"), "invalid int value: 'one'"),
    "seed out of range": (("run", "detection", "--seed", "-1"), "seed = -1: must be in [0, "),
    "absent config": (("run", "detection", "--config", "/absent.toml"), "/absent.toml: cannot be read"),
    "unwritable place": (("run", "detection", "--out", "/proc/run"), "/proc/run cannot be written"),
    "resume of nothing": (("resume", "/absent"), "/absent is not a run: there is no such directory"),
    "status of nothing": (("status", "/tmp"), "/tmp is not a run: it contains no config.toml"),
    "report of nothing": (("report", "/absent"), "/absent is not a run"),
    "export of nothing": (("export", "/absent"), "/absent is not a run"),
    "negative episode": (("replay", "/absent", "--seed", "-1"), "argument --seed: '-1': must be a whole number, 0 or"),
    "replay of nothing": (("replay", "/absent"), "/absent is not a run"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_gets_one_line_and_exit_code_2(call, case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments, complaint = BAD[case]
    code, out, err = call(*arguments)
    assert code == 2
    assert complaint in err
    assert err.count("\n") == 1
    assert out == ""
    assert list(tmp_path.iterdir()) == [], "no file may remain"


def test_tables_name_every_task_and_gene(call):
    assert [line.split()[0] for line in call("tasks")[1].splitlines()] == list(TASKS)
    lines = call("genes")[1].splitlines()
    table = lines[1 : lines.index("")]
    assert [line.split()[0] for line in table] == list(GENES)
    assert "[1, 512]" in table[list(GENES).index("neurons")]
    records = json.loads(call("genes", "--json")[1])
    assert [record["name"] for record in records] == list(GENES)
    assert all(record["meaning"] and record["mutation"] in ("Gaussian", "±1") for record in records)


def test_help_comes_at_once_and_names_the_commands():
    """Imports determine the time: 0.1 s without the heavy libraries, 1.4 s with any of them. Times differ between
    machines, so the test checks imports.
    """
    code = (
        "import sys; from evolve.cli.main import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        "print([m for m in ('torch', 'numpy', 'drjit', 'nevergrad', 'rich', 'mitsuba', 'mujoco') if m in sys.modules])"
    )
    child = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert child.stdout.splitlines()[-1] == "[]"
    for command in (
        "run",
        "resume",
        "status",
        "replay",
        "report",
        "export",
        "validate",
        "doctor",
        "tasks",
        "genes",
        "list",
        "config",
    ):
        assert f"\n    {command} " in child.stdout


FLAGS = {
    "run": ("--preset", "--config", "--set", "--out", "--dry-run", "--executor", "--scheduler", "--tls-key", "--json"),
    "resume": ("--executor", "--scheduler", "--tls-ca-file", "--tls-cert", "--json", "--tensorboard"),
    "status": ("--json", "--watch"),
    "compare": ("--json", "--html"),
    "drift": ("--json", "--searches"),
    "replay": ("--candidate", "--seed", "--rrd", "--gif", "--mp4"),
    "export": ("--candidate", "--seed"),
    "doctor": ("--json",),
    "genes": ("--json",),
}


@pytest.mark.parametrize("command", FLAGS)
def test_help_names_every_flag(command, capsys):
    with pytest.raises(SystemExit):
        main([command, "--help"])
    told = capsys.readouterr().out
    assert [flag for flag in FLAGS[command] if flag not in told] == []


def test_bare_command_shows_its_help(call):
    code, out, _ = call()
    assert code == 0
    assert "evolve run detection --preset quick" in out
    assert out == call("--help")[1]


def test_version(call):
    assert call("--version")[:2] == (0, f"rhabdom {__version__}\n")


def test_every_example_of_the_help_is_accepted():
    lines = [line for text in (FIRST, *EXAMPLES.values()) for line in text.splitlines() if line.startswith("  evolve")]
    assert len(lines) > 12
    for line in lines:
        words = line.split("   ")[0].split(">")[0].split()
        parse(words[1:])


def test_presets_say_what_they_are_for(call):
    lines = call("presets")[1].splitlines()
    assert [line.split()[0] for line in lines] == preset_names()
    records = {one["name"]: one for one in json.loads(call("presets", "--json")[1])}
    assert records["lens"] == {
        "name": "lens",
        "task": "detection",
        "scales": ["laptop", "paper"],
        "about": "Evolution of the pupil alone, then of pupil and lens.",
    }
    assert records["quick"]["task"] is None
    assert json.loads(call("tasks", "--json")[1]) == TASKS


def test_settings_that_are_shown_are_those_of_a_run(call, tmp_path):
    code, out, _ = call("config", "show", "tracking", "--preset", "quick", "--set", "search.population=7")
    assert code == 0
    (tmp_path / "shown.toml").write_text(out)
    assert from_toml(tmp_path / "shown.toml") == assemble("tracking", "quick", assignments=["search.population=7"])


def test_schema_knows_every_setting_and_its_range(call):
    known = json.loads(call("config", "schema")[1])["properties"]
    config = tomllib.loads(call("config", "show", "detection")[1])
    for section, values in config.items():
        assert section in known
        names = known[section].get("properties", {})
        for name, value in values.items() if isinstance(values, dict) and section != "genome" else ():
            assert names[name]["default"] == value
    assert known["search"]["properties"]["population"]["minimum"] == 2
    assert known["eye"]["properties"]["head_radius"]["exclusiveMinimum"] == 0
    assert known["eye"]["properties"]["rays_per_receptor"]["anyOf"][1] == {"const": "auto"}
    assert known["genome"]["properties"]["fov_deg"]["properties"]["start"]["maximum"] == GENES["fov_deg"].range.high
    assert set(config["genome"]) <= set(known["genome"]["properties"])


def test_completion_completes(call, tmp_path):
    """The test uses Bash's own completion."""
    script = tmp_path / "evolve"
    script.write_text(call("completion", "bash")[1])
    ask = f"source {script}; COMP_WORDS=(evolve run --pre); COMP_CWORD=2; _shtab_evolve; echo ${{COMPREPLY[@]}}"
    child = subprocess.run(["bash", "-c", ask], capture_output=True, text=True, check=False)
    assert child.stdout.split() == ["--preset"], child.stderr


def test_a_list_of_runs(call, finished, tmp_path):
    shutil.copytree(finished, tmp_path / "runs" / "good")
    (tmp_path / "runs" / "bad").mkdir()
    (tmp_path / "runs" / "bad" / "config.toml").write_text("task = 3")
    (tmp_path / "runs" / "other").mkdir()
    lines = dict(line.split(None, 1) for line in call("list", tmp_path / "runs")[1].splitlines())
    assert set(lines) == {str(tmp_path / "runs" / "good"), str(tmp_path / "runs" / "bad")}
    assert "finished    12 of 12 candidates, best fitness" in lines[str(tmp_path / "runs" / "good")]
    assert "unreadable: " in lines[str(tmp_path / "runs" / "bad")]
    found = {one["state"] for one in json.loads(call("list", tmp_path / "runs", "--json")[1])}
    assert found == {"finished", "unreadable"}
    assert call("list", tmp_path / "runs" / "other")[1].endswith("contains no runs\n")
