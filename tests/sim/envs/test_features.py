"""Every feature works in every task, or its refusal gives the reason."""

import numpy as np
import pytest

import sim
from sim.scene.variation import filter_to
from tests.sim.envs.test_task_vec_env import Face

EYES = sim.Eyes(n_eyes=2, resolution=(2, 3), noise_sigma=0.0)
SHARP = sim.Eyes(n_eyes=1, resolution=(3, 3), fov_deg=10.0)
PLAIN = sim.Fidelity(1, bands=4)


class BatchFace(sim.BatchTask):
    """The task `Face` for arrays of worlds."""

    model, mounts, eye, episode_steps = Face.model, Face.mounts, Face.eye, Face.episode_steps

    def reset(self, worlds, chosen, rngs):
        worlds.qpos[chosen, 0] = [rng.uniform(-0.5, 0.5) for rng in rngs]

    def rewards(self, worlds):
        return {"still": -np.abs(worlds.qvel[:, 0])}

    def proprioception(self, worlds):
        return worlds.qvel


def made(task, **options):
    """Return an environment of a built-in task, by name, or of a user task, whose settings are attributes."""
    if task in sim.TASKS:
        return sim.make_vec_env(task, options.pop("eyes", EYES), 3, seed=1, fidelity=PLAIN, **options)
    user = {"Task": Face, "BatchTask": BatchFace}[task]()
    user.fidelity = PLAIN
    eyes = options.pop("eyes", None)
    if isinstance(eyes, dict):
        user.eye = {name: of_kind.eye() for name, of_kind in eyes.items()}
        user.mounts = dict.fromkeys(eyes, user.mounts)
    for name in ("vary", "auxiliary"):
        if name in options:
            setattr(user, name, options.pop(name))
    return sim.make_vec_env(user, n_envs=3, seed=1, **options)


TASKS = (*sim.TASKS, "Task", "BatchTask")
FEATURES = {
    "light": {"vary": {"light": (0.1, 0.9)}},
    "color temperature": {"vary": {"color_temperature": (3000.0, 9000.0)}},
    "several kinds of eyes": {"eyes": {"wide": EYES, "sharp": SHARP}},
    "auxiliary": {"auxiliary": ("depth", "ids", "flow")},
    "memory": {"memory": 3},
    "evaluation": {"mode": "evaluation"},
    "least return": {"least_return": -3.0},
    "episode steps": {"episode_steps": 2},
    "picture of the world": {"render_mode": "rgb_array"},
    "picture of the eyes": {"render_mode": "eyes"},
}


@pytest.mark.fast_cases(10)
@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("feature", FEATURES)
def test_every_feature_serves_every_task(task, feature):
    env = made(task, **FEATURES[feature])
    observation = env.reset()
    assert env.observation_space.contains({name: array[0] for name, array in observation.items()})
    for _ in range(3):
        actions = np.full((3, *env.action_space.shape), 0.4, np.float32)
        observation, reward, _, infos = env.step(actions)
    assert np.isfinite(reward).all()
    assert env.observation_space.contains({name: array[0] for name, array in observation.items()})
    if "vary" in FEATURES[feature]:
        assert infos[0]["varied"].keys() == FEATURES[feature]["vary"].keys()
    if "render_mode" in FEATURES[feature]:
        assert all(picture.dtype == np.uint8 for picture in env.get_images())
    env.close()


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("task", TASKS)
def test_states_are_stored_and_restored(task):
    """The 70 actions exceed the random numbers that are drawn in advance for moving objects."""
    env = made(task)
    env.reset()
    random = np.random.default_rng(0)
    actions = random.uniform(-1, 1, (70, 3, *env.action_space.shape)).astype(np.float32)
    env.step(actions[0])
    stored = env.get_state()
    first = [env.step(action) for action in actions]
    env.set_state(stored)
    for (seen, reward, done, _), action in zip(first, actions, strict=True):
        again, reward_again, done_again, _ = env.step(action)
        np.testing.assert_array_equal(reward_again, reward)
        np.testing.assert_array_equal(done_again, done)
        for name, array in seen.items():
            np.testing.assert_array_equal(again[name], array)


@pytest.mark.parametrize("task", ["detection", "navigation"])
def test_a_colour_temperature_multiplies_every_band(task):
    """The product also holds for tracers that trace fewer components than there are bands."""
    kelvins = 3200.0
    warm, plain = (made(task, vary=vary) for vary in ({"color_temperature": (kelvins, kelvins)}, None))
    seen, white = warm.reset()["eyes"][:, -1], plain.reset()
    radiance = plain.renderer.receptor_radiance(plain.state)  # (band, world, eye, y, x)
    bands = EYES.eye().spectral_bands
    expected = np.einsum("cb,b,bnehw->nechw", bands.weights, filter_to(kelvins, bands.wavelengths), radiance)
    np.testing.assert_allclose(seen, expected, atol=2e-6)
    assert np.abs(seen - white["eyes"][:, -1]).max() > 0.05


@pytest.mark.parametrize("task", ["detection", "navigation", "maze", "tracking"])
def test_colours_of_built_in_worlds_vary(task):
    env = made(task, vary={"floor.color": ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))})
    env.reset()
    colors = env.simulation.varied["floor.color"]
    floor = env.worlds.model.geom("floor").id
    assert len(np.unique(colors, axis=0)) == 3
    models = env.worlds._appearances.models
    np.testing.assert_allclose([model.geom_rgba[floor, :3] for model in models], colors, atol=1e-6)


def test_encounters_need_a_body_for_each_animal():
    with pytest.raises(ValueError, match="'detection' has the body of one agent"):
        sim.Encounter("detection", Face())
