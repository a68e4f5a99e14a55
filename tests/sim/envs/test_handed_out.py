"""Arrays that environments and renderers hand out: writing into them changes no later step."""

import numpy as np
import pytest

import sim

EYES = sim.Eyes(n_eyes=2, resolution=(4, 4), fov_deg=45, placement_range_deg=60)
N, STEPS = 3, 8  # episodes of 5 steps, so that every world restarts


def arrays(thing):
    """Yield all arrays in nested lists, dictionaries and dataclasses."""
    if isinstance(thing, np.ndarray):
        yield thing
    elif isinstance(thing, dict):
        for part in thing.values():
            yield from arrays(part)
    elif isinstance(thing, (list, tuple)):
        for part in thing:
            yield from arrays(part)
    elif hasattr(thing, "__dataclass_fields__"):
        yield from arrays(vars(thing))


def overwrite(thing):
    """Write into every array that is not read-only. Return how many there are."""
    writable = [array for array in arrays(thing) if array.flags.writeable and array.dtype.kind in "fiub"]
    for array in writable:
        array[...] = 1 if array.dtype.kind != "f" else 7.7
    return len(writable)


def handed_out(venv):
    """Yield the arrays that an environment and its renderer return between two steps, apart from observations."""
    renderer = venv.renderer
    yield renderer.signals(venv.state), renderer.radiance(venv.state), renderer.receptor_radiance(venv.state)
    yield renderer.depth(venv.state), renderer.ids(venv.state), renderer.eye_frames(venv.state)
    yield renderer.bands, renderer.sensor, venv.state
    yield venv.get_state(), venv.get_images(), venv.reset_infos


def episodes(task, memory, writes):
    """Return the observations, rewards and endings of STEPS steps, with or without a user who writes into arrays."""
    venv = sim.make_vec_env(
        task, EYES, n_envs=N, memory=memory, render_mode="eyes", rays_per_receptor=4, episode_steps=5
    )
    actions, found, written = np.random.default_rng(0), [], 0
    observation = venv.reset()
    for _ in range(STEPS):
        found.append({name: array.copy() for name, array in observation.items()})
        if writes:
            written += overwrite(observation) + sum(map(overwrite, handed_out(venv)))
        observation, reward, done, infos = venv.step(actions.uniform(-1, 1, (N, 2)))
        found[-1] |= {"reward": reward.copy(), "done": done.copy()}
        if writes:
            written += overwrite((reward, done, infos))
    venv.close()
    assert written >= 10 * STEPS * writes
    return found


@pytest.mark.parametrize(("task", "memory"), [("detection", 1), ("navigation", 3)])
def test_writing_into_handed_out_arrays_changes_no_later_step(task, memory):
    for quiet, loud in zip(episodes(task, memory, False), episodes(task, memory, True), strict=True):
        for name, array in quiet.items():
            np.testing.assert_array_equal(array, loud[name], name)


def test_arrays_that_later_results_share_are_read_only():
    venv = sim.make_vec_env("detection", EYES, n_envs=N, rays_per_receptor=4)
    venv.reset()
    world = sim.build_world("navigation")
    course = sim.Course("######\n#S...#\n######")
    shared = [venv.state, venv.renderer.sensor, venv.renderer.bands, world, world.starts]
    found = [array for one in shared for array in arrays(one)] + [course.walls, course.goal, course.way, course.signs]
    assert len(found) > 15
    assert not any(array.flags.writeable for array in found)
