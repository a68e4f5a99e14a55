"""Images for human viewers, from stable-baselines3's `render` and its wrappers, and from PettingZoo."""

import numpy as np
import pytest
from stable_baselines3.common.vec_env import VecMonitor

import sim
from tests.sim.envs.hunt import Twin, hunt
from tests.sim.envs.test_task_vec_env import Face

EYES = sim.Eyes(n_eyes=1, resolution=(2, 3), bands=2)
MAKERS = {
    "rhabdom's own": lambda: sim.make_vec_env("detection", EYES, 2, render_mode="eyes", rays_per_receptor=1),
    "one's own": lambda: sim.make_vec_env(Face(), n_envs=2, render_mode="eyes"),
    "twins": lambda: sim.make_vec_env(sim.Encounter(Twin("prey"), Twin("predator")), n_envs=1, render_mode="eyes"),
}


@pytest.mark.parametrize("wrapped", [lambda env: env, VecMonitor], ids=["bare", "VecMonitor"])
@pytest.mark.parametrize("maker", MAKERS)
def test_what_eyes_report_is_shown_as_tiles(maker, wrapped):
    env = wrapped(MAKERS[maker]())
    env.reset()
    first, second = env.get_images()
    for mode in (None, "eyes"):
        np.testing.assert_array_equal(env.render(mode), np.concatenate([first, second]))


@pytest.mark.parametrize("maker", MAKERS)
def test_there_is_nothing_to_show_before_the_first_reset(maker):
    with pytest.raises(RuntimeError, match="have not begun: call reset first"):
        MAKERS[maker]().render()


@pytest.mark.parametrize("mode", ["eyes", "rgb_array"])
def test_an_encounter_that_has_not_begun_says_so(mode):
    env = sim.make_parallel_env(hunt(), render_mode=mode)
    with pytest.raises(RuntimeError, match=r"^the worlds have not begun: call reset first$"):
        env.render()
