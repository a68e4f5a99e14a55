"""The command line: bad input gets one line on stderr and exit code 2, never a traceback; help comes at once."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from evolve.cli.main import main
from evolve.config.run_config import TASKS
from evolve.genome.genotype import GENES

ROOT = Path(__file__).parents[3]

BAD = {
    "no command": ((), "COMMAND"),
    "unknown command": (("rnu", "detection"), "'rnu'"),
    "unknown task": (("run", "detecton"), "unknown task 'detecton'; did you mean 'detection'?"),
    "unknown preset": (("run", "detection", "--preset", "quik"), "did you mean 'quick'?"),
    "unknown gene": (("run", "detection", "--set", "genome.n_eye.open=false"), "did you mean 'n_eyes'?"),
    "unknown key": (("run", "detection", "--set", "serch.sigma=1"), "did you mean 'search'?"),
    "out of range": (("run", "detection", "--set", "search.population=1"), "must be in [2, 10000]"),
    "wrong type": (("run", "detection", "--seed", "one"), "invalid int value: 'one'"),
    "seed out of range": (("run", "detection", "--seed", "-1"), "seed = -1: must be in [0, "),
    "absent config": (("run", "detection", "--config", "/absent.toml"), "/absent.toml: cannot be read"),
    "unwritable place": (("run", "detection", "--out", "/proc/run"), "/proc/run cannot be written"),
    "resume of nothing": (("resume", "/absent"), "/absent is no run: there is no such directory"),
    "status of nothing": (("status", "/tmp"), "/tmp is no run: it holds no config.toml"),
    "report of nothing": (("report", "/absent"), "/absent is no run"),
    "export of nothing": (("export", "/absent"), "/absent is no run"),
    "negative episode": (("replay", "/absent", "--seed", "-1"), "argument --seed: '-1': must be a whole number, 0 or"),
    "replay of nothing": (("replay", "/absent"), "/absent is no run"),
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
    assert list(tmp_path.iterdir()) == [], "nothing may be left behind"


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
    """Imports decide: 0.1 s without, 1.4 s with any one of the heavy libraries. Seconds differ by machine."""
    code = (
        "import sys; from evolve.cli.main import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        "print([m for m in ('torch', 'numpy', 'drjit', 'nevergrad', 'rich', 'mitsuba', 'mujoco') if m in sys.modules])"
    )
    child = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert child.stdout.splitlines()[-1] == "[]"
    for command in ("run", "resume", "status", "replay", "report", "export", "validate", "doctor", "tasks", "genes"):
        assert f"\n    {command} " in child.stdout


FLAGS = {
    "run": ("--preset", "--config", "--set", "--out", "--dry-run", "--executor", "--scheduler", "--tls-key", "--json"),
    "resume": ("--executor", "--scheduler", "--tls-ca-file", "--tls-cert", "--json", "--tensorboard"),
    "status": ("--json", "--watch"),
    "compare": ("--json", "--html"),
    "replay": ("--candidate", "--seed", "--rrd"),
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
