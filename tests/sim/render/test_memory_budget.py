"""More rays than memory: one clear error, before anything is computed."""

import dataclasses
import math

import pytest

import optics
import sim
from sim.render import memory_budget
from sim.render.memory_budget import Demand, check_memory

EYES = sim.Eyes(n_eyes=2, resolution=(3, 4))
SOME = Demand(8, 64, 2, (15, 15), 1, 0)


@pytest.mark.parametrize("pupil", [None, optics.Pupil(30e-6)])
def test_a_renderer_says_what_it_has_room_for(pupil):
    world, eyes = sim.build_world("detection"), dataclasses.replace(EYES, optics=pupil)
    with pytest.raises(ValueError, match=r"rays_per_receptor = 1e\+07: 99 worlds .* GiB .* use at most .* rays"):
        sim.BatchedRenderer(world, eyes, 99, sim.Fidelity(1e7, eyes.bands))
    with pytest.raises(ValueError, match="fewer worlds at once"):
        sim.BatchedRenderer(world, eyes, 1, sim.Fidelity(1, eyes.bands)).resized(10**9)


def test_what_it_recommends_fits(monkeypatch):
    monkeypatch.setattr(memory_budget, "available", lambda: 1e9)
    check_memory(SOME)
    with pytest.raises(ValueError, match="use at most") as error:
        check_memory(dataclasses.replace(SOME, rays_per_receptor=1e6))
    most = float(str(error.value).split("at most ")[1].split()[0])
    check_memory(dataclasses.replace(SOME, rays_per_receptor=most))
    with pytest.raises(ValueError, match="at most"):
        check_memory(dataclasses.replace(SOME, rays_per_receptor=1.2 * most))


def test_weights_behind_a_pupil_count():
    assert dataclasses.replace(SOME, weights=24).bytes - SOME.bytes == 8 * 225 * 24 * 15 * 16


def test_more_than_an_array_can_number_is_refused_whatever_the_memory(monkeypatch):
    monkeypatch.setattr(memory_budget, "available", lambda: math.inf)
    with pytest.raises(ValueError, match="use at most"):
        check_memory(dataclasses.replace(SOME, rays_per_receptor=2**20))


def test_memory_is_known():
    assert 1e8 < memory_budget.available() < 1e14
