"""Half precision is refused and lazy bits of PyTorch are resolved wherever arrays enter `sim`."""

import dataclasses

import mujoco
import numpy as np
import pytest
import torch

import sim
from sim.envs.calls import actions_of
from sim.scene.cameras import Viewpoint
from sim.scene.rays import checked_wavelengths
from sim.scene.variation import Variation
from sim.tasks import batch_arrays
from sim.worlds.state import WorldState


def image(a, label="radiance", **more):
    nm = {} if label == "receptors" else {"wavelengths_nm": [500, 600]}
    view = sim.View("left", **nm, **{label: a}, **more)
    return getattr(view, label)


def rgb(a):
    return sim.View("left", [500, 600], np.ones((2, 4, 4)), rgb=a).rgb


def looking_at(a):
    return Viewpoint.looking_at(a, [0.0, 0.0, 0.0]).rotation


CASES = {
    "radiance": ((2, 4, 4), image),
    "reflectance": ((2, 4, 4), lambda a: image(a, "reflectance")),
    "receptors": ((2, 4, 4), lambda a: image(a, "receptors")),
    "rgb": ((4, 4, 3), rgb),
    "wavelengths_nm": ((2,), lambda a: [sim.View("left", 500 + 9 * a, np.ones((2, 4, 4))).spectral]),
    "peaks_nm": ((2,), lambda a: [sim.View("left", receptors=np.ones((2, 4, 4)), peaks_nm=500 + a).receptors]),
    "offset": ((3,), lambda a: sim.Mount("agent", offset=a).offset),
    "azimuth_deg": ((), lambda a: sim.Mount("agent", azimuth_deg=a).azimuth_deg),
    "wavelengths": ((3,), lambda a: checked_wavelengths(a if a.dtype in HALF else 1e-7 * (4 + a))),
    "origin": ((3,), looking_at),
}
HALF = (np.float16, torch.float16, torch.bfloat16)


def lazy(array):
    """Return a tensor of these numbers that PyTorch has yet to negate."""
    return torch.complex(torch.zeros(array.shape, dtype=torch.float64), torch.tensor(-array)).conj().imag


def plain(found):
    return np.asarray(found.resolve_neg() if torch.is_tensor(found) else found, float)


@pytest.mark.parametrize("name", CASES)
def test_lazy_tensors_and_half_precision(name):
    shape, enter = CASES[name]
    array = np.asarray(np.random.default_rng(47).random(shape))
    np.testing.assert_allclose(plain(enter(lazy(array))), plain(enter(array)), rtol=1e-12)
    for coarse in (array.astype(np.float16), torch.tensor(array).half(), torch.tensor(array).bfloat16()):
        with pytest.raises(ValueError, match=r"must be float32 or float64, not b?float16"):
            enter(coarse)


def test_images_of_lazy_tensors_are_written(tmp_path):
    array = np.random.default_rng(1).random((2, 4, 4))
    sim.write_exr(tmp_path / "a.exr", [sim.View("left", [500, 600], lazy(array), receptors=lazy(array))])
    (view,) = sim.read_exr(tmp_path / "a.exr")
    np.testing.assert_array_equal(view.radiance, array.astype(np.float32))
    np.testing.assert_array_equal(view.receptors, array.astype(np.float32))


@pytest.mark.parametrize("name", ["geom_xpos", "xmat", "light_xdir", "geom_size"])
def test_poses(name):
    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    poses = sim.Poses.from_data(data)
    with pytest.raises(ValueError, match=f"{name}: must be float32 or float64, not float16"):
        dataclasses.replace(poses, **{name: getattr(poses, name).astype(np.float16)})


@pytest.mark.parametrize("name", ["position", "heading", "objects"])
def test_states_of_worlds(name):
    shapes = {field.name: (3, 2, 3) if field.name == "objects" else (3, 2) for field in dataclasses.fields(WorldState)}
    arrays = {key: np.zeros(shape) for key, shape in shapes.items()}
    WorldState(**arrays)
    with pytest.raises(ValueError, match=f"{name}: must be float32 or float64, not float16"):
        WorldState(**arrays | {name: arrays[name].astype(np.float16)})


def test_ranges_of_variation():
    low, high = np.array([0.1, 0.2, 0.3]), np.array([0.5, 0.6, 0.7])
    for name in ("agent.start", "wall.color"):
        expected = Variation({name: (low, high)}).draw(np.random.default_rng(0))
        found = Variation({name: (lazy(low), lazy(high))}).draw(np.random.default_rng(0))
        np.testing.assert_array_equal(found[name], expected[name])
        with pytest.raises(ValueError, match=f"vary: {name}: must be float32 or float64, not float16"):
            Variation({name: (low.astype(np.float16), high.astype(np.float16))})


def test_actions_and_rewards_may_be_lazy_tensors():
    """Actions, rewards and observations may be in half precision, since nothing is computed from small differences."""
    actions = np.full((2, 3), 0.25)
    for given in (lazy(actions), torch.tensor(actions).half()):
        np.testing.assert_array_equal(actions_of("actions", given, actions.shape), np.float32(actions))
    rewards = np.array([0.5, 1.0])
    np.testing.assert_array_equal(batch_arrays.rows("rewards", lazy(rewards), 2, float), rewards)
    np.testing.assert_array_equal(batch_arrays.rows("rewards", rewards.astype(np.float16), 2, float), rewards)
