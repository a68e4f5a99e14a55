"""Every change of a record is detected by the checksums of its lines, and the lines before it remain usable."""

import json
import random

import pytest

from evolve.search.loop import evolve
from evolve.store.chain import Chain, sealed_record
from evolve.store.directory import Run, RunError
from evolve.store.record import Record
from tests.evolve.search.kills import Here, Nobody, carry
from tests.evolve.store.handwriting import records_of
from tests.evolve.store.records import CONFIG, candidate

LINES = 6


@pytest.fixture
def record(run):
    """Return the path of a record with six lines."""
    for number in range(LINES):
        run.append(candidate(number))
    return run.path / "candidates.jsonl"


def with_other_digit(content, chance, first=0):
    """Return the content with one digit changed after the position `first`, and the number of the line."""
    place = chance.choice([i for i, byte in enumerate(content) if i >= first and chr(byte).isdigit()])
    digit = chance.choice([digit for digit in b"0123456789" if digit != content[place]])
    return content[:place] + bytes([digit]) + content[place + 1 :], content[:place].count(b"\n") + 1


def test_a_changed_digit_is_detected_and_its_line_is_named(record):
    content, chance = record.read_bytes(), random.Random()
    for _ in range(100):
        changed, line = with_other_digit(content, chance)
        record.write_bytes(changed)
        found = Record.read(record, CONFIG, before_damage=True)
        assert f"candidates.jsonl, line {line}: is damaged: " in found.notice
        assert len(found.candidates) == line - 1
    with pytest.raises(RunError, match=f"line {line}: .*--before-damage uses only the {line - 1} lines before it"):
        Run.open(record.parent)


def test_lines_that_are_missing_moved_repeated_or_stripped_are_detected(record):
    whole = record.read_bytes().splitlines(keepends=True)
    stripped = [json.dumps(line).encode() + b"\n" for line in records_of(record)]
    number = random.randrange(1, LINES - 1)
    before, after = whole[:number], whole[number + 1 :]
    for changed in (
        before + after,
        [*before, *reversed(whole[number:])],
        [*before, stripped[number], *after],
        [*before, whole[number].replace(b"checksum", b"checksun"), *after],
    ):
        record.write_bytes(b"".join(changed))
        with pytest.raises(RunError, match=f"line {number + 1}: is damaged"):
            Run.open(record.parent)
    record.write_bytes(b"".join(whole[:number]))
    assert len(Run.open(record.parent).candidates) == number, "a shorter record is one of an earlier moment"


def test_a_record_without_checksums_opens_and_its_chain_starts_with_the_next_line(record, call):
    old = random.randrange(1, LINES)
    lines = records_of(record)
    record.write_text("".join(json.dumps(line) + "\n" for line in lines[:old]))
    assert f"checksums: the first {old} lines of the record have none" in call("status", record.parent)[1]
    run = Run.open(record.parent)
    run.repair()
    for number in range(old, LINES):
        run.append(candidate(number))
    told = json.loads(call("status", record.parent, "--json")[1])
    assert (told["lines_without_checksum"], told["notice"]) == (old, None)
    content = record.read_bytes()
    record.write_bytes(content.replace(b"0.3333", b"0.3334", 1))  # a return of the first line
    with pytest.raises(RunError, match=f"line {old + 1}: .* the line and the {old} lines before it, which have none"):
        Run.open(record.parent)
    changed, line = with_other_digit(content, random.Random(), content.rindex(b"\n", 0, -1))
    record.write_bytes(changed)
    with pytest.raises(RunError, match=f"line {line}: is damaged"):
        Run.open(record.parent)


def test_new_records_are_checked_from_their_first_line(record, call):
    assert Run.open(record.parent).record.unchecked == 0
    assert "checksums" not in call("status", record.parent)[1]


def test_a_record_written_at_once_equals_one_written_line_by_line(record):
    written = record.read_bytes()
    assert sealed_record(candidate(number).to_line() for number in range(LINES)) == written
    chain = Chain()
    for line in written.splitlines(keepends=True):
        chain = chain.after(line)
    with pytest.raises(ValueError, match="no checksum"):
        chain.after(candidate(LINES).to_line().encode())


@pytest.mark.parametrize("command", ["status", "compare"])
def test_commands_name_the_line_and_use_the_lines_before_it_on_request(record, call, command):
    content = record.read_bytes()
    changed, line = with_other_digit(content, random.Random(), content.index(b"\n"))
    record.write_bytes(changed)
    code, out, err = call(command, record.parent)
    assert (code, out) == (2, "")
    assert err.startswith(f"evolve: error: {record}, line {line}: is damaged: ")
    code, out, err = call(command, record.parent, "--before-damage")
    assert code == 0
    assert f"{line - 1} of 12" in out
    assert record.read_bytes() == changed, "reading must not write"


def test_a_run_continues_before_the_damage_to_the_record_of_an_undisturbed_one(tmp_path):
    path = tmp_path / "run"
    record, chance = path / "candidates.jsonl", random.Random()
    carry(path, CONFIG)
    whole, content = records_of(record), record.read_bytes()
    last = content.rindex(b"\n", 0, -1) + 1
    changed, line = with_other_digit(content[:last], chance)
    changed += content[last:-9]  # the last line is torn
    record.write_bytes(changed)
    with pytest.raises(RunError, match=f"line {line}: is damaged"):
        carry(path, CONFIG)
    assert record.read_bytes() == changed
    run = Run.open(path, before_damage=True)
    with run.lock():
        run.repair()
        evolve(run, Here(tmp_path / "run.log"), Nobody())
    assert (path / "candidates.jsonl.damaged-1").read_bytes() == changed
    assert f"line {line}: is damaged" in run.notice
    assert Run.open(path).notice is None
    assert records_of(record) == whole
