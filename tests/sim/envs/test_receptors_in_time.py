"""Environments of eyes whose receptors have dynamics: frames within an action, noise, states and refusals."""

from contextlib import closing
from dataclasses import replace

import mujoco
import numpy as np
import pytest

import optics
import sim
from sim.envs.frame_choice import with_frames
from sim.envs.prepared_task import PreparedTask
from sim.physics.mujoco_worlds import MujocoWorlds
from sim.render.fidelity import Fidelity, Level
from sim.tasks.registry import task_of
from sim.tasks.simulation import Simulation

SLOW = optics.ReceptorDynamics(150.0, order=2, latency_ms=40.0, frames=5)
RAYS = Fidelity(1, 2)


def eyes(dynamics, **more):
    return sim.Eyes(
        **{"n_eyes": 2, "resolution": (2, 6), "fov_deg": 90, "bands": 2, "noise_sigma": 0.0, **more}, dynamics=dynamics
    )


def actions(n, steps, seed=0):
    return np.random.default_rng(seed).uniform(-1, 1, (steps, 1, 2)).astype(np.float32).repeat(n, axis=1)


def observed(eyes_, n=2, steps=40, task="detection", seed=3, **more):
    with closing(sim.make_vec_env(task, eyes_, n, seed=seed, **{"fidelity": RAYS, **more})) as venv:
        seen = [venv.reset()["eyes"]]
        seen += [venv.step(action)[0]["eyes"] for action in actions(n, steps)]
    return np.array(seen)


def test_receptors_without_memory_see_as_without_dynamics():
    instant = optics.ReceptorDynamics(1e-3, frames=1)
    plain, timed = (observed(eyes(d, noise_sigma=0.05)) for d in (None, instant))
    assert timed == pytest.approx(plain, abs=1e-6)
    assert not np.array_equal(observed(eyes(SLOW, noise_sigma=0.05)), plain)


def test_the_observation_is_the_filtered_light_of_all_frames():
    """The reference is an independent sum over frames: the integral of the impulse response over a frame, times its
    signals.
    """
    task = task_of(sim.build_world("detection"), "training", eyes=eyes(None), fidelity=RAYS)
    renderer = sim.BatchedRenderer(task.world, eyes(None), 2, RAYS)
    light = []
    with closing(Simulation(task, 2, 3)) as worlds:
        worlds.physics.frames = 5
        worlds.reset()
        light.append(renderer.signals(worlds.poses()))
        for action in actions(2, 12):
            worlds.move(action)
            light += [renderer.signals(poses) for poses in (*worlds.physics.passed, worlds.poses())]
            worlds.judge({})
    light = np.array(light)
    x = 40.0 / 150.0 * np.arange(200)  # frames of 40 ms
    share = np.diff(1 - np.exp(-x) * (1 + x))
    # The first frame lasts for ever before the episode. Because of the latency, the last frame does not count yet.
    history = np.concatenate([np.repeat(light[:1], 199, axis=0), light[1:]])
    seen = observed(eyes(SLOW), steps=12)
    for k in range(13):
        end = 199 + 5 * k - (k > 0)
        expected = np.einsum("k,k...->...", share, history[:end][::-1][: len(share)])
        assert seen[k, :, 0] == pytest.approx(expected, abs=2e-5)


def test_episodes_do_not_depend_on_other_worlds():
    noisy = eyes(SLOW, noise_sigma=0.05, photon_budget=optics.PhotonBudget(1.0, 0.02))
    many, one = (observed(noisy, n, 60, mode="evaluation") for n in (12, 1))
    assert np.array_equal(many[:, :1], one)


@pytest.mark.parametrize(
    "dynamics", [SLOW, optics.ReceptorDynamics(event_threshold=0.05, motion="barlow_levick", frames=1)]
)
def test_a_stored_state_contains_the_receptors(dynamics):
    noisy = eyes(dynamics, noise_sigma=0.05)
    with closing(sim.make_vec_env("detection", noisy, 3, fidelity=RAYS)) as venv:
        venv.reset()
        first, later = actions(3, 5), actions(3, 5, 1)
        for action in first:
            venv.step(action)
        state = venv.get_state()
        runs = []
        for _ in range(2):
            venv.set_state(state)
            runs.append([venv.step(action)[0]["eyes"] for action in later])
    assert np.array_equal(*runs)


def test_photons_are_counted_once():
    """Behind a slow filter h, the variance of shot noise follows from ∫h² alone. It must not be reduced by the
    integration time as well.
    """
    budget = optics.PhotonBudget(30.0, 0.02)
    pupil = optics.Pupil(20e-6, thin_lens_focal_length=240e-6)
    for tau in (400.0, 1600.0):
        dynamics = optics.ReceptorDynamics(tau, frames=2)
        e = eyes(dynamics, optics=pupil, photon_budget=budget)
        with closing(sim.make_vec_env("detection", e, 64, seed=0, fidelity=RAYS)) as venv:
            photons = venv.renderer.eye.photons
            first = venv.reset()["eyes"]
            standing = np.tile([-1.0, 0.0], (64, 1)).astype(np.float32)
            for _ in range(60):
                last = venv.step(standing)[0]["eyes"]
            clean = venv.renderer.signals(venv.simulation.poses())
        usable = clean.mean(axis=(0, 1, 3, 4)) > 0
        excess = np.square(last[:, 0] - clean).mean(axis=(0, 1, 3, 4))
        seconds = 0.1
        step = 1 - np.exp(-1e3 * seconds / tau)
        expected = clean.mean(axis=(0, 1, 3, 4)) / photons * 0.02 / seconds * step / (2 - step)
        assert excess[usable] == pytest.approx(expected[usable], rel=0.25)
        assert first.shape == last.shape


def test_motion_detectors_are_further_channels():
    seen = observed(eyes(optics.ReceptorDynamics(20.0, motion="hassenstein_reichardt", frames=2)))
    assert seen.shape[4] == 2 * 3
    assert np.abs(seen[1:, :, 0, :, 3:]).max() > 1e-3
    assert (seen[..., -1][:, :, 0, :, 3:] == 0).all()


SPINNING = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 0.1"/>
    <body name="box" pos="0 0 0.3"><freejoint/><geom type="box" size="0.1 0.05 0.02"/><camera name="eye"/></body>
    <body name="arm" pos="1 0 0.5">
      <joint name="j" axis="0 1 0"/><geom type="capsule" size="0.02" fromto="0 0 0 0.3 0 0"/>
    </body>
  </worldbody>
</mujoco>
"""


def test_frames_do_not_change_the_physics_of_a_model():
    ends = []
    for frames in (1, 5):
        worlds = MujocoWorlds(SPINNING, mujoco.MjModel.from_xml_string(SPINNING), 2, substeps=20)
        for world in range(2):
            worlds.start_episode(world, {})
            worlds.datas[world].qvel[:] = [1, 2, 0, 3, 5, 7, 1][: worlds.model.nv]
        worlds.settle(np.arange(2))
        worlds.frames, heights = frames, []
        for _ in range(10):
            assert worlds.step(()) == {}
            assert len(worlds.passed) == frames - 1
            heights += [poses.xpos[0, 1, 2] for poses in (*worlds.passed, worlds.poses())]
        ends.append(worlds.get_state()["physics"])
    assert np.array_equal(*ends)
    assert len(set(heights)) == 50


def test_frames_do_not_change_the_physics_of_agents():
    ends = []
    for frames in (1, 10):
        task = task_of(sim.build_world("tracking"), "training", eyes=eyes(None), fidelity=RAYS)
        with closing(Simulation(task, 3, 0)) as worlds:
            worlds.physics.frames = frames
            worlds.reset()
            start = worlds.poses().positions.copy()
            worlds.step(actions(3, 1)[0])
            ends.append(worlds.poses().positions)
            passed = worlds.physics.passed
    assert np.array_equal(*ends)
    way = np.array([start, *(poses.positions for poses in passed), ends[1]])
    # Agents accelerate without turning back, and objects move evenly.
    assert (np.linalg.norm(np.diff(way[:, :, 0], axis=0), axis=2)[1:] >= 0).all()
    assert way[5, :, 1:] == pytest.approx((start + ends[1])[:, 1:] / 2)


def test_the_fewest_frames_whose_error_is_allowed_are_chosen():
    fast = optics.ReceptorDynamics(2.0)
    slow = optics.ReceptorDynamics(100.0)
    found = {}
    for name, dynamics in (("fast", fast), ("slow", slow), ("stated", optics.ReceptorDynamics(100.0, frames=10))):
        e = eyes(dynamics, noise_sigma=0.02)
        with closing(sim.make_vec_env("navigation", e, 2, rays_per_receptor=4)) as venv:
            fidelity = venv.renderer.fidelity
            found[name] = fidelity.frames
            assert venv.simulation.physics.frames == fidelity.frames
    assert found["fast"] == 1  # only the last frame matters
    assert 1 < found["slow"] < 10
    assert found["stated"] == 10


def test_frames_that_do_not_fit_are_refused_in_one_line():
    with pytest.raises(ValueError, match=r"frames = 3: must be a divisor of the 10 physics steps") as raised:
        sim.make_vec_env("detection", eyes(optics.ReceptorDynamics(frames=3)), 1, rays_per_receptor=1)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(("one", "other"), [(1, 2), (2, 1), (5, 10)])
def test_different_frames_of_two_kinds_of_eyes_are_refused(one, other):
    both = {"one": eyes(optics.ReceptorDynamics(frames=one)), "other": eyes(optics.ReceptorDynamics(frames=other))}
    less, more = sorted((one, other))
    with pytest.raises(ValueError, match=f"^frames = {less} and {more}: must be the same for all eyes of a world$"):
        sim.make_vec_env("detection", both, 1, rays_per_receptor=1)


def test_several_kinds_of_eyes_share_their_frames():
    both = {"slow": eyes(SLOW), "fast": eyes(optics.ReceptorDynamics(1.0, motion="barlow_levick")), "plain": eyes(None)}
    with closing(sim.make_vec_env("detection", both, 2, rays_per_receptor=1, render_mode="eyes")) as venv:
        venv.reset()
        seen = venv.step(actions(2, 1)[0])[0]
        assert {name: seen[name].shape for name in both} == {
            "slow": (2, 1, 2, 3, 2, 6),
            "fast": (2, 1, 2, 6, 2, 6),
            "plain": (2, 1, 2, 3, 2, 6),
        }
        assert venv.simulation.physics.frames == 5
        assert venv.get_images()[0].ndim == 3


def test_the_table_of_a_fidelity_states_the_frames_and_their_error():
    prepared = PreparedTask(
        task_of(
            sim.build_world("detection"),
            "training",
            eyes=eyes(optics.ReceptorDynamics(100.0), noise_sigma=0.02),
            fidelity=Fidelity(4, 2, levels=(Level("rays", "4", None, "as requested"),), tolerance=0.01),
        )
    )
    level = prepared.fidelity.levels[-1]
    assert (level.stage, level.level) == ("frames", f"{prepared.fidelity.frames} per action")
    assert 0 < level.predicted_error <= 0.01
    assert f"{prepared.fidelity.frames} per action" in str(prepared.fidelity)


def test_stated_frames_are_added_once_and_only_to_eyes_in_use():
    task = task_of(sim.build_world("detection"), "training", eyes=eyes(SLOW))
    given = Fidelity(4, 2, levels=(Level("rays", "4", None, "as requested"),))
    [agent] = task.agents()
    [once] = with_frames(task, [{kind.name: given for kind in agent.kinds}], None)
    for fidelity in once.values():
        assert fidelity.frames == 5
        assert fidelity.levels == (*given.levels, Level("frames", "5 per action", None, "as requested"))
    assert with_frames(task, [once], None) == [once]
    assert with_frames(task, [None], None) == [None]
    [plain] = with_frames(task, [dict.fromkeys(once, replace(given, levels=()))], None)
    assert all((fidelity.frames, fidelity.levels) == (5, ()) for fidelity in plain.values())


def test_dynamics_of_another_type_are_refused():
    with pytest.raises(ValueError, match="Eyes: dynamics = 20"):
        eyes(20)
    with pytest.raises(ValueError, match="dynamics"):
        optics.Eye(dynamics=20)


def test_a_world_that_breaks_down_leaves_the_others_as_they_are():
    seen = []
    for spoilt in (False, True):
        with closing(sim.make_vec_env("detection", eyes(SLOW), 3, fidelity=RAYS)) as venv:
            venv.reset()
            venv.step(actions(3, 1)[0])
            if spoilt:
                position = venv.state.position.copy()
                position[0] = np.nan
                venv.simulation.state = replace(venv.state, position=position)
            seen.append([venv.step(action)[0]["eyes"] for action in actions(3, 4, 1)])
    assert np.isfinite(seen).all()
    assert np.array_equal(*np.array(seen)[:, :, 1:])
    assert not np.array_equal(*np.array(seen)[:, :, :1])


def test_poses_of_a_model_that_breaks_down_are_those_after_the_action():
    worlds = MujocoWorlds(SPINNING, mujoco.MjModel.from_xml_string(SPINNING), 3, substeps=20)
    for world in range(3):
        worlds.start_episode(world, {})
    worlds.settle(np.arange(3))
    worlds.frames = 4
    worlds.datas[1].qvel[0] = 1e12
    assert list(worlds.step(())) == [1]
    after = worlds.poses()
    assert len(worlds.passed) == 3
    for earlier in worlds.passed:
        assert np.isfinite(earlier.xpos).all()
        assert np.array_equal(earlier.xpos[1], after.xpos[1])
        assert not np.array_equal(earlier.xpos[[0, 2]], after.xpos[[0, 2]])
