"""A request for more rays than fit into memory gives one clear error before any computation."""

import dataclasses
import math

import mujoco
import pytest

import optics
import sim
from sim.eyes.depth_layers import DepthLayers
from sim.render import eye_renderer, memory_budget
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


@pytest.mark.parametrize(("pupil", "per_layer"), [(None, 0), (optics.Pupil(30e-6), 3)])
def test_each_depth_layer_has_planes_and_behind_a_pupil_weights(monkeypatch, pupil, per_layer):
    """The demand of a renderer: a plane per layer and component of light, and weights per layer and band."""
    asked = []
    monkeypatch.setattr(eye_renderer, "check_memory", asked.append)
    eyes = dataclasses.replace(EYES, optics=pupil, bands=3)
    layers = DepthLayers(nearest=0.5, count=2) if pupil else DepthLayers()
    renderer = sim.BatchedRenderer(sim.build_world("detection"), eyes, 2, sim.Fidelity(2, 3, depth=layers))
    demand = asked[-1]
    count = renderer.fidelity.depth.count
    assert (demand.worlds, demand.eyes, demand.resolution) == (2, 2, (3, 4))
    assert demand.planes == count * len(renderer.tracer.basis)
    assert demand.weights == count * per_layer
    assert demand.rays_per_receptor == len(renderer.sensor.directions) / 12


def test_each_band_of_a_model_has_a_plane(monkeypatch):
    """Light in a MuJoCo model has one component per band."""
    asked = []
    monkeypatch.setattr(eye_renderer, "check_memory", asked.append)
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><visual><headlight active='0'/></visual><worldbody><light type='directional'/><geom size='1'/>"
        "<camera name='c' pos='0 -4 0'/></worldbody></mujoco>"
    )
    eye = optics.Eye(optics.Pupil(30e-6), resolution=(3, 4), fov_deg=20, bands=5)
    sim.ModelRenderer(model, eye, [sim.Mount("c")], 2, sim.Fidelity(2, 5, depth=DepthLayers(nearest=0.5, count=2)))
    assert (asked[-1].planes, asked[-1].worlds, asked[-1].eyes) == (2 * 5, 2, 1)


def test_more_than_an_array_can_number_is_refused_whatever_the_memory(monkeypatch):
    monkeypatch.setattr(memory_budget, "available", lambda: math.inf)
    with pytest.raises(ValueError, match="use at most"):
        check_memory(dataclasses.replace(SOME, rays_per_receptor=2**20))


def test_memory_is_known():
    assert 1e8 < memory_budget.available() < 1e14


V2 = {
    "memory.max": "8000000",
    "memory.current": "5000000",
    "memory.stat": "anon 9\nactive_file 300\ninactive_file 20\n",
}
V1 = {
    "memory/memory.limit_in_bytes": "9000000\n",
    "memory/memory.usage_in_bytes": "7000000\n",
    "memory/memory.stat": "active_file 5\ninactive_file 6\ntotal_active_file 70\ntotal_inactive_file 8\n",
}


def groups(root, files):
    """Return a folder of control groups as a container sees it."""
    for name, text in files.items():
        (root / name).parent.mkdir(exist_ok=True)
        (root / name).write_text(text)
    return root


@pytest.mark.parametrize(
    ("files", "free"),
    [
        ({}, math.inf),
        (V2, 3_000_320),
        ({**V2, "memory.max": "max\n"}, math.inf),
        ({name: text for name, text in V2.items() if name != "memory.stat"}, 3_000_000),
        ({**V2, "memory.stat": "no numbers"}, 3_000_000),
        ({**V2, "memory.current": "8000321"}, 1),
        ({"memory.max": "8000000"}, math.inf),
        (V1, 2_000_078),
        ({**V1, "memory/memory.limit_in_bytes": "9223372036854771712"}, 9223372036854771712 - 7_000_000 + 78),
        ({**V1, **V2}, 2_000_078),
    ],
)
def test_a_containers_limit_counts(tmp_path, monkeypatch, files, free):
    """The cache of files can be freed, and does not count as used memory."""
    monkeypatch.setattr(memory_budget, "CGROUPS", groups(tmp_path, files))
    monkeypatch.setattr(memory_budget, "_of_machine", lambda: math.inf)
    assert memory_budget.available() == free
    monkeypatch.setattr(memory_budget, "_of_machine", lambda: 7.0)
    assert memory_budget.available() == min(free, 7)


def test_a_container_without_room_is_told_in_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(memory_budget, "CGROUPS", groups(tmp_path, {**V2, "memory.current": "9000000"}))
    with pytest.raises(ValueError, match=r"use at most .* rays per receptor, or fewer worlds at once") as error:
        check_memory(SOME)
    assert "\n" not in str(error.value)
