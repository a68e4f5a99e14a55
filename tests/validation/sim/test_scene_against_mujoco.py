"""The comparison of the page on two models that are shipped with gymnasium. It detects a mirror that does not follow
the model's data, and one that is rotated.
"""

import importlib.util
from pathlib import Path

import mujoco
import numpy as np
import pytest

from sim.scene.cameras import Viewpoint
from sim.scene.mirror import Mirror
from validation.sim import scene_against_mujoco

ASSETS = Path(importlib.util.find_spec("gymnasium").origin).parent / "envs" / "mujoco" / "assets"


def row(name, monkeypatch):
    monkeypatch.setattr(scene_against_mujoco, "POSES", 2)
    monkeypatch.setattr(scene_against_mujoco, "WIDTH", 160)
    monkeypatch.setattr(scene_against_mujoco, "HEIGHT", 120)
    try:
        return scene_against_mujoco.compare(name, mujoco.MjModel.from_xml_path(str(ASSETS / f"{name}.xml")))
    except RuntimeError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize("name", ["ant", "pusher"])
def test_models_that_others_made_are_mirrored(name, monkeypatch):
    found = row(name, monkeypatch)
    assert scene_against_mujoco.broken_bounds([found]) == []
    assert found.geoms >= 14
    assert "headlight" in found.lacks


def test_a_mirror_that_stands_still_is_caught(monkeypatch):
    monkeypatch.setattr(Mirror, "sync", lambda self, data: setattr(self, "_data", data))
    assert scene_against_mujoco.broken_bounds([row("ant", monkeypatch)])


def test_a_mirror_seen_from_the_side_is_caught(monkeypatch):
    true = Viewpoint.looking_at
    monkeypatch.setattr(Viewpoint, "looking_at", lambda a, b, fovy=45.0: true(a, b, 1.02 * fovy))
    assert scene_against_mujoco.broken_bounds([row("pusher", monkeypatch)])


def test_poses_are_in_range_and_differ():
    model = mujoco.MjModel.from_xml_path(str(ASSETS / "humanoid.xml"))
    shots = list(scene_against_mujoco.poses(model, np.random.default_rng(0)))
    hinges = [j for j in range(model.njnt) if model.jnt_limited[j]]
    angles = np.array([shot.qpos[model.jnt_qposadr[hinges]] for shot in shots])
    assert (angles >= model.jnt_range[hinges, 0]).all()
    assert (angles <= model.jnt_range[hinges, 1]).all()
    assert (np.ptp(angles, axis=0) > 0).all()
    assert {shot.camera for shot in shots} == {-1, *range(model.ncam)}


def test_stored_page_tells_what_the_script_says():
    stored = Path("docs/validation/scene_against_mujoco.md").read_text(encoding="utf-8")
    fresh = scene_against_mujoco.Page("scene_against_mujoco", scene_against_mujoco.__doc__, "", []).markdown
    assert stored.startswith(fresh.split("```")[0])
    rows = [line.split()[2:5] for line in stored.split("```")[1].splitlines() if line.count("%") >= 3 and "/" in line]
    shares = np.array([[float(x.rstrip("%")) / 100 for x in cells] for cells in rows])
    assert len(shares) > 40
    assert (shares[:, 0] >= scene_against_mujoco.SAME_GEOM).all()
    assert (shares[:, 2] >= scene_against_mujoco.SAME_DEPTH).all()
