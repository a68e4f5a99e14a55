"""The comparison of the page on models that are shipped with gymnasium. It detects moving geoms that are rendered as
static, and eyes that look in a wrong direction.
"""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

import sim
from sim.tracing.movers import Movers
from validation.sim import eyes_against_ray_caster

ASSETS = Path(importlib.util.find_spec("gymnasium").origin).parent / "envs" / "mujoco" / "assets"


def row(name, monkeypatch):
    monkeypatch.setattr(eyes_against_ray_caster, "WORLDS", 2)
    monkeypatch.setattr(eyes_against_ray_caster, "RESOLUTION", (30, 40))
    monkeypatch.setattr(eyes_against_ray_caster, "MANY", 2)
    monkeypatch.setattr(eyes_against_ray_caster, "ROUNDS", 1)
    model = eyes_against_ray_caster.with_camera(ASSETS / f"{name}.xml", np.random.default_rng(0))
    with pytest.warns(sim.MirrorWarning):
        return eyes_against_ray_caster.compare(name, model, np.random.default_rng(1))


@pytest.mark.parametrize(("name", "moving"), [("ant", 13), ("humanoid", 17), ("pusher", 19)])
def test_eyes_see_models_that_others_made(name, moving, monkeypatch):
    found = row(name, monkeypatch)
    assert eyes_against_ray_caster.broken_bounds([found]) == []
    assert found.moving == moving
    assert found.rate > 0


def test_movers_that_stand_still_are_caught(monkeypatch):
    rows, first = Movers.rows, []

    def still(self, poses):
        first.append(rows(self, poses))
        return np.repeat(first[0][:1], poses.n, axis=0)

    monkeypatch.setattr(Movers, "rows", still)
    assert eyes_against_ray_caster.broken_bounds([row("ant", monkeypatch)])


def test_eyes_turned_aside_are_caught(monkeypatch):
    monkeypatch.setattr(
        eyes_against_ray_caster, "mounts_on", lambda model: [sim.Mount(eyes_against_ray_caster.CAMERA, azimuth_deg=2)]
    )
    frames = sim.ModelRenderer.eye_frames
    straight = sim.Mount(eyes_against_ray_caster.CAMERA)

    def before(self, poses):
        kind, index = straight.found_in(self.model)
        origins, rotations = poses.frames(kind, index)
        return origins[:, None], (rotations @ straight.local(kind)[1])[:, None]

    def expected(renderer, datas):
        monkeypatch.setattr(sim.ModelRenderer, "eye_frames", before)
        found = right(renderer, datas)
        monkeypatch.setattr(sim.ModelRenderer, "eye_frames", frames)
        return found

    right = eyes_against_ray_caster.expected
    monkeypatch.setattr(eyes_against_ray_caster, "expected", expected)
    assert eyes_against_ray_caster.broken_bounds([row("ant", monkeypatch)])


def test_stored_page_tells_what_the_script_says():
    stored = Path("docs/validation/eyes_against_ray_caster.md").read_text(encoding="utf-8")
    fresh = eyes_against_ray_caster.Page("eyes_against_ray_caster", eyes_against_ray_caster.__doc__, "", []).markdown
    assert stored.startswith(fresh.split("```")[0])
    shares = [line.split()[2] for line in stored.split("```")[1].splitlines() if line.count("%") == 2]
    assert len(shares) > 15
    assert min(float(share.rstrip("%")) for share in shares) >= 100 * eyes_against_ray_caster.SAME
