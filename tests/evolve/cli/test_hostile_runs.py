"""A run from a stranger, given to every command: one line that names the fault, exit code 2, and no traceback."""

import os

import pytest

from evolve.store.directory import Run
from tests.evolve.closed_form import tiny
from tests.evolve.hostile_records import VALUES, line
from tests.evolve.store.records import candidate
from tests.slow_part import slow

COMMANDS = ("status", "compare", "report", "replay", "resume", "export")
CONFIGS = {
    "6,000 digits": "seed = " + "7" * 6000,
    "a number beyond all floats": "[eye]\nsensor_width = 1" + "0" * 400,
    "thousands of hexadecimal digits": "seed = 0x" + "f" * 6000,
    "100,000 brackets": "seed = " + "[" * 100_000 + "]" * 100_000,
    "infinite": "[eye]\nsensor_width = inf",
    "not a number": "[eye]\nnoise_sigma = nan",
    "unknown key with an escape": '"\\u001b[31m" = 1',
    "a date": "seed = 1979-05-27",
    "tables where a number belongs": "[seed]\nvalue = 1",
}


@pytest.fixture
def run(tmp_path):
    run = Run.create(tmp_path / "run", tiny())
    run.append(candidate(1))
    return run


def refused(call, command, path, complaint):
    code, out, err = call(command, path)
    assert code == 2, err
    assert complaint in err
    assert err.count("\n") == 1
    assert len(err) < 1000
    assert out == ""
    assert err.replace("\n", "").isprintable()


@pytest.mark.fast_cases(16)
@pytest.mark.parametrize("commands", [COMMANDS[:1], slow(COMMANDS[1:])], ids=[COMMANDS[0], "the others"])
@pytest.mark.parametrize("damage", VALUES)
def test_damaged_records_are_named_by_every_command(call, run, damage, commands):
    with (run.path / "candidates.jsonl").open("a") as file:
        file.write(line(*VALUES[damage]))
    before = {path: path.read_bytes() for path in run.path.rglob("*") if path.is_file()}
    for command in commands:
        refused(call, command, run.path, "candidates.jsonl, line 2: is damaged: ")
    assert {path: path.read_bytes() for path in run.path.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize("damage", CONFIGS)
def test_damaged_configs_are_named_by_every_command(call, run, damage):
    config = run.path / "config.toml"
    text = config.read_text()
    key = CONFIGS[damage].split(" = ")[0].splitlines()[-1]
    kept = [row for row in text.splitlines() if not row.startswith(f"{key} = ")]
    table, _, setting = CONFIGS[damage].rpartition("\n")
    if table in kept:
        kept.insert(kept.index(table) + 1, setting)
    else:
        kept = [*CONFIGS[damage].splitlines(), *kept] if "[seed]" not in table else [*kept, "", table, setting]
    config.write_text("\n".join(row for row in kept if "[seed]" not in table or not row.startswith("seed =")))
    for command in COMMANDS:
        refused(call, command, run.path, "config.toml")


@pytest.mark.parametrize("name", ["config.toml", "candidates.jsonl", "versions.json", "lock", "policies"])
@pytest.mark.parametrize("kind", ["link", "FIFO"])
def test_links_and_fifos_are_named_by_every_command_and_lead_nowhere(call, run, tmp_path, name, kind):
    """No command waits for a FIFO's writer, either."""
    victim = tmp_path / "thesis.tex"
    victim.write_text("all of it")
    place = run.path / name
    place.rmdir() if place.is_dir() else place.unlink()
    place.symlink_to(victim) if kind == "link" else os.mkfifo(place)
    for command in COMMANDS:
        refused(call, command, run.path, f"{place}: is a {'symbolic link' if kind == 'link' else kind}: must be a ")
    code, _, err = call("run", "detection", "--preset", "quick", "--out", run.path)
    assert (code, err.count("\n")) == (2, 1)
    assert victim.read_text() == "all of it"


def test_links_where_products_are_written_are_refused(call, finished, tmp_path):
    """Pages replace an existing file. A link might lead to a user's own page, so it is refused."""
    victim = tmp_path / "thesis.html"
    victim.write_text("all of it")
    page = tmp_path / "page.html"
    page.symlink_to(victim)
    code, _, err = call("compare", finished, "--html", page)
    assert code == 2
    assert f"{page}: is a symbolic link" in err
    assert victim.read_text() == "all of it"
