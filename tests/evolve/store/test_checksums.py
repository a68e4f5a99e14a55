"""Changes of a run's config.toml and EXR files are noticed."""

import random
from contextlib import suppress

import numpy as np
import pytest

import sim
from evolve.report.exr_export import list_checksums
from evolve.store.checksums import LISTED, harmed
from evolve.store.directory import Run
from sim.exr.files import ExrError


def views(seed):
    chance = np.random.default_rng(seed)
    return [
        sim.View("left", np.array([450.0, 550.0]), chance.random((2, 3, 4), dtype=np.float32)),
        sim.View("right", receptors=chance.random((1, 3, 4), dtype=np.float32), attributes={"seed": seed}),
    ]


def equal(some, others):
    return all(
        a.name == b.name
        and dict(a.attributes) == dict(b.attributes)
        and np.array_equal(a.wavelengths_nm, b.wavelengths_nm)
        and all(np.array_equal(getattr(a, name), getattr(b, name)) for name in ("radiance", "receptors", "rgb"))
        for a, b in zip(some, others, strict=True)
    )


def with_other_bit(content, chance):
    place = chance.randrange(len(content))
    return content[:place] + bytes([content[place] ^ 1 << chance.randrange(8)]) + content[place + 1 :]


@pytest.fixture
def exported(run):
    """Return a run with three EXR files, written in two exports."""
    (run.path / "exr").mkdir()
    files = [run.path / "exr" / f"{number}.exr" for number in range(3)]
    for number, file in enumerate(files):
        sim.write_exr(file, views(number))
    list_checksums(run.path / "exr", files[:2])
    list_checksums(run.path / "exr", files[1:])
    return run, files


def test_a_changed_bit_of_an_exr_file_is_noticed(exported, call):
    run, files = exported
    assert run.notice is None
    chance = random.Random()
    for _ in range(20):
        file = chance.choice(files)
        whole = file.read_bytes()
        file.write_bytes(with_other_bit(whole, chance))
        assert f"1 EXR files do not match their checksums ({file.name})" in harmed(run.path / "exr")
        file.write_bytes(whole)
    file.write_bytes(whole[:-1])
    assert "do not match their checksums" in call("status", run.path)[2]
    file.unlink()
    assert Run.open(run.path).notice is None, "files that were deleted can be exported again"


def test_reading_a_changed_exr_file_fails_or_gives_the_same_images(tmp_path):
    path, chance = tmp_path / "one.exr", random.Random()
    sim.write_exr(path, views(0))
    whole, intact = path.read_bytes(), sim.read_exr(path)
    for _ in range(200):
        path.write_bytes(with_other_bit(whole, chance))
        with suppress(ExrError):
            assert equal(sim.read_exr(path), intact)


def test_entries_of_other_files_are_kept(exported):
    run, files = exported
    listed = run.path / "exr" / LISTED
    foreign = f"{'0' * 64}  ../thesis.tex\nnot a checksum\n"
    listed.write_text(foreign + listed.read_text())
    list_checksums(run.path / "exr", files[:1])
    assert listed.read_text().startswith(foreign)
    assert len(listed.read_text().splitlines()) == 5
    assert harmed(run.path / "exr") is None


def test_a_changed_digit_of_the_config_is_noticed(run, call):
    config, chance = run.path / "config.toml", random.Random()
    whole = config.read_text()
    assert run.notice is None
    for setting in ("seed = ", "generations = ", "low = "):
        place = whole.index(setting) + len(setting)
        digit = chance.choice([digit for digit in "12345" if digit != whole[place]])
        config.write_text(whole[:place] + digit + whole[place + 1 :])
        code, _, err = call("status", run.path)
        assert code == 2 or "note: config.toml has changed since the last start" in err
    config.write_text(whole)
    assert call("status", run.path)[2] == ""
