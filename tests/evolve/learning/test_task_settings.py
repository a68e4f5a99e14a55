"""Every setting of a user task changes an output, or it is refused or named in a warning."""

import random
import warnings
from contextlib import closing
from functools import cache

import numpy as np
import pytest

import sim
from evolve.config.assemble import assemble
from evolve.config.checks import ConfigError
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from evolve.learning.animal_task import animal_task
from evolve.learning.task_module import executed_task
from evolve.learning.task_trial import UnusedSettingWarning, check_settings
from optics.numerics import backend
from sim.envs import world_pictures
from sim.envs.prepared_task import PreparedTask
from sim.tasks.task_settings import TaskSettings

# The cart's third action fails, so that `failure_reward` has an effect.
TASK = '''
import mujoco
import numpy as np
import optics
import sim

MODEL = """
<mujoco>
  <visual><headlight active="0"/></visual>
  <option timestep=".02"/>
  <asset><material name="red" rgba=".9 .2 .1 1"/></asset>
  <worldbody>
    <light type="directional" dir="-.3 -.4 -1" diffuse=".9 .9 .9"/>
    <geom type="plane" size="6 3 .1" rgba=".3 .3 .3 1"/>
    <camera name="above" pos="0 0 6"/>
    <body name="cart" pos="0 0 .2">
      <joint name="slide" type="slide" axis="0 1 0" damping="1"/>
      <geom type="box" size=".15 .2 .1" rgba=".2 .4 .8 1" mass="1"/>
    </body>
    <body name="ball" pos="2 0 .3">
      <joint name="roll" type="slide" axis="0 1 0" damping="1"/>
      <geom name="ball" size=".3" material="red" mass="1"/>
    </body>
  </worldbody>
  <actuator>
    <velocity name="slide" joint="slide" kv="10" ctrlrange="-2 2"/>
    <velocity name="roll" joint="roll" kv="10" ctrlrange="-2 2"/>
  </actuator>
</mujoco>"""


class Ball(sim.Task):
    model = MODEL
    mounts = (sim.Mount("ball", azimuth_deg=180, offset=(-.31, 0, 0)),)
    actuators = ("roll",)
    episode_steps = 20

    def rewards(self, data):
        return {"none": 0.0}


class Cart(sim.Task):
    model = MODEL
    mounts = (sim.Mount("cart", offset=(0.26, 0, 0.12)),)
    actuators = ("slide",)
    episode_steps = 20

    def rewards(self, data):
        return {"near": -abs(data.qpos[0])}

    def terminated(self, data):
        return {}["end"] if data.time > 0.25 else False

    def proprioception(self, data):
        return np.append(data.qpos[:2], data.time)


class Changed(Cart):
'''
EFFECT = None
# For each setting: a changed definition, and the words of a warning or an error in environments and in runs. EFFECT:
# the definition changes what a task does.
SETTINGS = {
    "model": ('MODEL.replace(".9 .2 .1 1", ".1 .8 .3 1")', EFFECT, EFFECT),
    "eye": ("optics.Eye(resolution=(2, 5), bands=4)", EFFECT, "eye has no effect: the genome"),
    "mounts": ('(sim.Mount("cart", azimuth_deg=9, offset=(0.26, 0, 0.12)),)', EFFECT, EFFECT),
    "fidelity": ("sim.Fidelity(3, bands=4)", EFFECT, "fidelity has no effect: the run has eye.rays_per_receptor = 2"),
    "substeps": ("4", EFFECT, EFFECT),
    "episode_steps": ("1", EFFECT, EFFECT),
    "spectra": ('{"red": optics.Spectrum((400.0, 700.0), (0.5, 0.5))}', EFFECT, EFFECT),
    "vary": ('{"light": (0.3, 0.4)}', EFFECT, EFFECT),
    "auxiliary": ('("depth",)', EFFECT, "auxiliary = .* has no effect: evolving eyes have no"),
    "camera": ('"above"', EFFECT, EFFECT),
    "actuators": ('("slide", "roll")', EFFECT, EFFECT),
    "name": ('"Ben"', EFFECT, EFFECT),
    "medium": ('"coastal_water"', EFFECT, EFFECT),
    "failure_reward": ("-3.0", EFFECT, EFFECT),
    "mode": ('"evaluation"', "mode = 'evaluation': must be left out", "mode = 'evaluation': must be left out"),
    "others": ("(sim.Frozen(Ball(), lambda seen: np.ones((1, 1))),)", EFFECT, EFFECT),
}
QUICK = ("eye.optics=false", "genome.n_eyes.start=1")


@pytest.fixture(scope="module", autouse=True)
def _device():
    """Let images of worlds be small: at full size, they would take most of the time."""
    backend.require()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(world_pictures, "PICTURE", (36, 48))
        yield


def written(folder, line):
    file = folder / "carts.py"
    file.write_text(f"{TASK}    {line}\n")
    return f"{file}:Changed"


def of_environment(named, **_):
    """Return the task for environments."""
    return executed_task(assemble(named, "quick", assignments=QUICK).choice.named_code)


def of_run(named, settings=()):
    """Return the task of the run's first animal, after the checks at the start of a run."""
    config = assemble(named, "quick", assignments=[*QUICK, *settings])
    check_settings(config)
    return animal_task(develop(Genotype(config.genome).start, config), config).task


def outputs(task):
    """Return all outputs of a few actions. Noise depends on the seed alone."""
    task.fidelity = sim.Fidelity(2, bands=4) if task.fidelity == "auto" else task.fidelity
    prepared = PreparedTask(sim.tasks.user_tasks.batched(task))
    found = [sim.Encounter(task).names if not task.others else ()]
    with closing(prepared.vec_env(1, 0, 1, render_mode="rgb_array")) as worlds, warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # the failure that `terminated` provokes
        seen = worlds.reset()
        for _ in range(3):
            found += [{name: part.tolist() for name, part in seen.items()}, worlds.get_images()[0].tobytes()]
            seen, reward, done, _ = worlds.step(np.full((1, *worlds.action_space.shape), 0.5, np.float32))
            found += [reward.tolist(), done.tolist()]
    return found


@cache
def unchanged(face, folder):
    """Return the outputs of the unchanged task. They are computed twice, because outputs that vary on their own could
    not show an effect."""
    named = written(folder, "pass")
    first = outputs(face(named))
    assert outputs(face(named)) == first, "the outputs do not repeat"
    return first


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("unchanged")


def test_the_table_names_every_setting():
    named = {*vars(TaskSettings)["__annotations__"], *vars(sim.Task)["__annotations__"]}
    assert set(SETTINGS) == named


@pytest.mark.parametrize("face", [of_environment, of_run])
@pytest.mark.parametrize("name", SETTINGS)
def test_every_setting_has_an_effect_or_is_named(name, face, tmp_path, folder):
    value, *words = SETTINGS[name]
    said = words[face is of_run]
    named = written(tmp_path, f"{name} = {value}")
    before = unchanged(face, folder)
    if said is EFFECT:
        with warnings.catch_warnings():
            warnings.simplefilter("error", UnusedSettingWarning)
            assert outputs(face(named)) != before
    elif said.startswith("mode"):
        with pytest.raises(ConfigError, match=said):
            face(named)
    else:
        with pytest.warns(UnusedSettingWarning, match=f"carts.py:Changed: {said}"):
            assert outputs(face(named)) == before


def test_rays_of_the_task_apply_unless_the_run_has_its_own(tmp_path):
    """The bands are always those of the run."""
    named, automatic = written(tmp_path, "fidelity = sim.Fidelity(3, bands=7)"), ("eye.rays_per_receptor=auto",)
    with pytest.warns(UnusedSettingWarning, match=r"fidelity\.bands = 7 has no effect: the run has eye.bands = 4"):
        task = of_run(named, automatic)
    assert task.fidelity == sim.Fidelity(3, bands=4)


@pytest.mark.parametrize("seed", range(3))
def test_several_mounts_are_refused_unless_place_is_defined(seed, tmp_path):
    """The default `place` would use the first mount only. With a `place` of its own, the task may use all of them."""
    draw = random.Random(seed)
    names = [draw.choice(["cart", "ball"]) for _ in range(draw.randint(2, 5))]
    mounts = ", ".join(f"sim.Mount({name!r}, offset=(0.32, 0, 0.12))" for name in names)
    line = f"mounts = ({mounts},)"
    with pytest.raises(
        ConfigError, match=f"Changed: mounts has {len(names)} of sim.Mount .on '{names[0]}', "
    ) as caught:
        of_run(written(tmp_path, line))
    assert "\n" not in str(caught.value)
    own = f"{line}\n\n    def place(self, n_eyes, *where):\n        return self.mounts[-n_eyes:]\n"
    assert [mount.on for mount in of_run(written(tmp_path, own)).mounts] == names[-1:]
