"""Replays and EXR files of a run: from Python and from the command line, and the metadata that identify them."""

import json
import shutil
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import evolve
import sim
from evolve.config.assemble import to_toml
from evolve.config.checks import ConfigError
from evolve.report import exr_export, replay
from evolve.store.directory import Run, RunError
from evolve.store.versions import fingerprint, present, provenance, run_id


@pytest.fixture(scope="module")
def exported(run, tmp_path_factory):
    """Return the files of an export from Python."""
    return evolve.Run.open(run.path).export(seed=3, every=64, out=str(tmp_path_factory.mktemp("python") / "exr"))


@pytest.fixture
def recorded(episode, monkeypatch):
    """Replace the recording of an episode by the one with seed 3; return the list of requests."""
    requests = []

    def record(pictured, run, candidate_id, seed, every, pictures=False, mode="evaluation"):
        assert pictures is pictured, "only pages show the images"
        requests.append((run.path, candidate_id, seed, every))
        return episode

    for module, pictured in ((exr_export, False), (replay, True)):
        monkeypatch.setattr(module, "record", partial(record, pictured))
    return requests


def test_python_and_the_command_export_the_same_files(run, exported, recorded, call, tmp_path):
    code, out, _ = call("export", run.path, "--seed", 3, "--every", 64, "--json", "--out", tmp_path / "exr")
    assert code == 0
    files = [tmp_path / "exr" / path.name for path in exported]
    assert json.loads(out)["exr"] == [str(path) for path in files]
    assert [path.name[-8:-4] for path in files] == ["0000", "0064", "0128", "0192"]
    assert [path.read_bytes() for path in files] == [path.read_bytes() for path in exported]
    assert (tmp_path / "exr" / "SHA256SUMS").exists()
    evolve.Run.open(run.path).export(out=tmp_path / "default")
    assert call("export", run.path, "--quiet", "--candidate", 0, "--out", tmp_path / "default")[0] == 0
    assert recorded == [(run.path, None, 3, 64), (run.path, None, 0, 8), (run.path, 0, 0, 8)]


@pytest.mark.parametrize(
    ("mode", "message"), [("training", "must be one of evaluation, test"), ("test", "has no test set"), (3, "mode = 3")]
)
def test_an_episode_in_another_mode_is_refused(run, mode, message):
    with pytest.raises(ConfigError, match=message):
        evolve.Run.open(run.path).replay(mode=mode)


def test_files_identify_the_run(run, exported):
    for path in exported:
        for view in sim.read_exr(path):
            known = view.attributes
            assert known["run"] == run.path.name
            assert known["run_id"] == run_id(run.path)
            assert known["settings"] == fingerprint(to_toml(run.config))
            start = json.loads((run.path / "versions.json").read_text())[0]
            assert known.get("run_commits", []) == [start["versions"]["commit"]] * bool(start["versions"]["commit"])
            assert known.get("commit", "") == present()["commit"]
            assert (known["candidate"], known["seed"]) == (0, 3)


def test_files_state_the_pose_of_each_eye(run, exported, episode):
    """The eyes look along their azimuths, relative to the heading of the animal, and stand upright."""
    mounts = 0
    for path, t in zip(exported, (0, 64, 128, 192), strict=True):
        for eye, view in enumerate(sim.read_exr(path)):
            known = view.attributes
            turned = known["heading_rad"] + np.radians(known["eye_azimuth_deg"])
            right, up, ahead = (np.array(known[f"eye_{name}"]) for name in ("right", "up", "ahead"))
            np.testing.assert_allclose(ahead, [np.cos(turned), np.sin(turned), 0], atol=1e-9)
            np.testing.assert_allclose(up, [0, 0, 1], atol=1e-12)
            np.testing.assert_allclose(np.cross(right, ahead), up, atol=1e-12)
            assert known["eye_position_m"] == episode.scene.eye_positions[t, eye].tolist()
            assert np.hypot(*np.subtract(known["eye_position_m"][:2], known["position_m"])) < 0.5
            mounts += 1
    assert mounts == 8


def test_the_id_belongs_to_the_run_and_not_to_its_directory(run, tmp_path):
    copy = shutil.copytree(run.path, tmp_path / "elsewhere", ignore=shutil.ignore_patterns("policies"))
    assert run_id(copy) == run_id(run.path) != ""
    other = Run.create(tmp_path / "other", replace(run.config, seed=99))
    assert run_id(other.path) != run_id(run.path)
    (copy / "versions.json").unlink()
    assert run_id(copy) == ""
    assert not {"run_id", "run_commits"} & provenance(copy).keys(), "unknown values are missing"
    assert {"run", "settings"} <= provenance(copy).keys()


def test_python_and_the_command_write_the_same_page(run, recorded, call, tmp_path, monkeypatch):
    monkeypatch.setattr(replay, "BESIDE", {"gif": lambda episode, path: path})
    pages = evolve.Run.open(run.path).replay(0, 3, also=["gif"], out=tmp_path / "python.html")
    assert pages == [tmp_path / "python.html", tmp_path / "python.gif"]
    assert call("replay", run.path, "--candidate", 0, "--seed", 3, "--quiet", "--out", tmp_path / "page.html")[0] == 0
    assert (tmp_path / "page.html").read_bytes() == pages[0].read_bytes()
    assert recorded == [(run.path, 0, 3, 8)] * 2


def test_every_reaches_recordings_for_rerun(run, recorded, monkeypatch, tmp_path):
    monkeypatch.setattr(replay, "require_rerun", lambda: None)
    monkeypatch.setattr(replay, "BESIDE", {**replay.BESIDE, "rrd": lambda episode, path: path})
    opened = evolve.Run.open(run.path)
    for every in (None, 3):
        assert opened.replay(every=every, also=("rrd",), out=tmp_path / "page.html")[1] == tmp_path / "page.rrd"
    assert [every for *_, every in recorded] == [8, 3]


@pytest.mark.parametrize("every", ["0", "-1", "1.5", "many", "1000001"])
def test_bad_intervals_are_refused_by_the_commands(run, call, every):
    for command in ("export", "replay"):
        code, out, err = call(command, run.path, f"--every={every}")
        assert (code, out) == (2, "")
        assert f"argument --every: {every!r}: must be a whole number from 1 to 1,000,000" in err
        assert err.count("\n") == 1


def test_an_interval_without_effect_is_refused(run, call, monkeypatch):
    monkeypatch.setattr(replay, "record", None)
    code, _, err = call("replay", run.path, "--every", 4)
    assert (code, err) == (
        2,
        "evolve: error: every = 4: needs rrd, because only recordings for Rerun show the scene\n",
    )


@pytest.mark.parametrize(
    ("arguments", "error", "says"),
    [
        ({"every": 0}, ValueError, r"every = 0: must be a whole number in \[1, 1000000\]"),
        ({"every": 2.5}, ValueError, r"every = 2\.5: must be a whole number"),
        ({"seed": -1}, ConfigError, "seed = -1: must be a whole number, 0 or more"),
        ({"seed": "3"}, ConfigError, "seed = '3': must be a whole number"),
        ({"seed": True}, ConfigError, "seed = true: must|seed = True: must"),
        ({"out": 3}, ConfigError, "out = 3: must be a path"),
        ({"candidate_id": 7}, RunError, "there is no candidate 7"),
    ],
)
def test_bad_arguments_are_refused_in_a_line(run, arguments, error, says, tmp_path, monkeypatch):
    monkeypatch.setattr(replay, "require_rerun", lambda: None)
    opened, at = evolve.Run.open(run.path), {"out": tmp_path / "out.html"}
    with pytest.raises(error, match=says) as caught:
        opened.export(**{**at, **arguments})
    assert "\n" not in str(caught.value)
    with pytest.raises(error, match=says):
        opened.replay(**{**at, "also": ("rrd",) if "every" in arguments else (), **arguments})


@pytest.mark.parametrize("also", ["gif", ["avi"]])
def test_unknown_formats_are_refused(run, also):
    with pytest.raises(ConfigError, match="must be a list of rrd, gif, mp4"):
        evolve.Run.open(run.path).replay(also=also)
