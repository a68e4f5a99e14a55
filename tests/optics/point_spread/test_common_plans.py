"""Members of a population that share plans, from given numbers of turns and errors."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from optics import Grid
from optics.point_spread import population

WINDOW = Grid((5, 7), 2e-6, (0.0, 0.0))


def together(
    monkeypatch, turns, tolerance=1e-2, window=WINDOW, light=1.0, model=0.001, apertures=None, stack=2_000_000
):
    """Yield the members that share plans, and the arguments of the plans' parts, for given numbers of turns."""
    apertures = apertures or ["circle"] * len(turns)
    members = [
        SimpleNamespace(plain=at is not None, pupil=SimpleNamespace(aperture=a))
        for at, a in zip(turns, apertures, strict=True)
    ]
    asked = []

    def from_members(some):
        return SimpleNamespace(members=list(some), n=len(some))

    def samples(aperture, turns, ripple):
        asked.append((aperture, turns, ripple))
        return SimpleNamespace(at=np.zeros(10))

    def images(own, samples, masks, window):
        asked.append(own.n)
        return np.arange(1.0, own.n + 1)[:, None, None] * np.ones(window.shape)

    known = [at for at in turns if at is not None]
    monkeypatch.setattr(population, "STACK", stack)
    monkeypatch.setattr(population, "_Stack", SimpleNamespace(from_members=from_members))
    monkeypatch.setattr(population, "_turns", lambda own, window: (known, [0.1 * k for k in range(len(known))]))
    monkeypatch.setattr(population, "_samples", samples)
    monkeypatch.setattr(population, "_masks", lambda own, samples: "masks")
    monkeypatch.setattr(population, "_images", images)
    monkeypatch.setattr(population, "_model_errors", lambda own, images, window: np.full(own.n, model))
    monkeypatch.setattr(population, "_light", lambda samples, masks: np.array([light]))
    monkeypatch.setattr(population, "_plan", lambda member, samples, window, error, leaving: (error, leaving))
    for member in members:
        member.pupil.aperture = Area(member.pupil.aperture)
    return list(population.population_pictures(members, window, tolerance)), asked


class Area(str):
    """An aperture with an area of 2, in units of the squared radius."""

    area = 2.0


def test_members_share_plans_by_aperture_and_turns(monkeypatch):
    """Numbers of turns are rounded up to powers of 1.3, at least to 1."""
    found, asked = together(monkeypatch, [0.2, 1.0, 1.2, None, 1.3, math.inf, 1.31], apertures=list("aaaaaab"))
    assert [index for index, *_ in found] == [0, 1, 2, 4, 6]
    assert [one for one in asked if not isinstance(one, int)] == [
        ("a", 1.0, pytest.approx(3e-3)),
        ("a", pytest.approx(1.3), pytest.approx(3e-3)),
        ("b", pytest.approx(1.69), pytest.approx(3e-3)),
    ]
    assert [one for one in asked if isinstance(one, int)] == [2, 2, 1]
    np.testing.assert_allclose([image[0, 0] for _, image, _ in found], [0.5, 1, 0.5, 1, 0.5])
    errors, leaving = zip(*(plan for *_, plan in found), strict=True)
    assert errors == pytest.approx([0.001 + 0.2 * 1e-2] * 5)
    assert leaving == pytest.approx([0, 0.1, 0.2, 0.3, 0.5])


@pytest.mark.parametrize(
    ("given", "count"),
    [
        ({}, 2),
        ({"tolerance": 1e-3, "model": 0.0}, 2),
        ({"tolerance": 0.99e-3, "model": 0.0}, 0),
        ({"window": Grid((5, 7), 2e-6, (1e-9, 0.0))}, 0),
        ({"model": 0.008}, 2),
        ({"model": 0.00801}, 0),
        ({"light": 1e-2}, 2),
        ({"light": 0.99e-2}, 0),
        ({"stack": 100}, 2),
        ({"stack": 99}, 0),
    ],
)
def test_limits_of_common_plans(monkeypatch, given, count):
    assert len(together(monkeypatch, [1.0, 1.0], **given)[0]) == count
    assert together(monkeypatch, [None, None], **given)[0] == []


@pytest.mark.parametrize(("stack", "sizes"), [(500, [5]), (499, [4, 1]), (250, [2, 2, 1]), (120, [1] * 5)])
def test_sizes_of_stacks(monkeypatch, stack, sizes):
    """Each member has 100 samples of its pupil, and 35 of its window."""
    assert together(monkeypatch, [1.0] * 5, stack=stack)[1][1:] == sizes
    wide = together(monkeypatch, [1.0] * 5, stack=stack, window=Grid((20, 10), 2e-6, (0.0, 0.0)))[1][1:]
    assert wide == {500: [2, 2, 1], 499: [2, 2, 1], 250: [1] * 5, 120: [1] * 5}[stack]
