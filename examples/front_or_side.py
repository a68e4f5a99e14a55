"""Eyes in front or at the sides? Prey with two eyes evolves their placement under a predator that hunts by sight.

    evolve run examples/front_or_side.py:Prey --config examples/front_or_side.toml

The predator is frozen: it has eyes and a fixed rule instead of a learned policy. It comes from a random direction or,
in half of the episodes, not at all. An empty view therefore does not reveal whether a predator is present. In
`Blindfold`, the null model, the prey does not see the predator, while the predator sees the prey. Run as a script, the
file prints the results of prey that always runs ahead. `--trainings 3` trains prey with eyes in front and at the sides
three times each, in both worlds, as within a run.
"""

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from rhabdom import optics, sim

PREY_SPEED, PREDATOR_SPEED, TURN = 0.6, 1.0, 2.0  # m/s, m/s, rad/s
NEAR, AWAY, CAUGHT = 2.0, 30.0, 0.4  # [m] initial distance of the predator if it comes, if not; distance of capture
EFFORT = 0.3  # cost of running, relative to the reward of running from a predator

FIELD = """
<mujoco>
  <visual><headlight active="0"/></visual>
  <option timestep=".05" gravity="0 0 0"/>
  <default><geom contype="0" conaffinity="0" mass="1"/></default>
  <worldbody>
    <light type="directional" dir="1 .2 -.5" diffuse=".8 .8 .8"/>
    <light type="directional" dir="-.7 .9 -.5" diffuse=".8 .8 .8"/>
    <light type="directional" dir="-.4 -1 -.5" diffuse=".8 .8 .8"/>
    <geom type="plane" size="40 40 .1" rgba=".3 .3 .3 1"/>
    <body name="prey" pos="0 0 .3">
      <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
      <geom size=".2" rgba=".1 .2 .9 1"/>
    </body>
    <body name="predator" pos="2 0 .3">
      <joint type="slide" axis="1 0 0" ref="2"/><joint type="slide" axis="0 1 0"/><joint axis="0 0 1"/>
      <geom size=".25" rgba=".9 .1 .1 1" group="0"/>
    </body>
  </worldbody>
</mujoco>"""


class Predator(sim.Task):
    """Runs ahead at full speed; its action is the turning rate."""

    model = FIELD
    eye = optics.Eye(resolution=(1, 15), fov_deg=100, bands=4)
    mounts = (sim.Mount("predator", offset=(0.26, 0, 0)),)
    fidelity = sim.Fidelity(2, bands=4)
    substeps, episode_steps = 2, 40

    def reset(self, data, rng):
        comes, bearing = rng.random() < 0.5, rng.uniform(-np.pi, np.pi)
        place = (NEAR if comes else AWAY) * np.array([np.cos(bearing), np.sin(bearing)])
        data.qpos[2:] = *place, bearing + np.pi

    def n_actions(self, model):
        return 1

    def act(self, data, action):
        heading = data.qpos[4]
        data.qvel[2:] = PREDATOR_SPEED * np.cos(heading), PREDATOR_SPEED * np.sin(heading), TURN * action[0]


def chase(observation):
    """Return the turning rate towards blue areas.

    It is the mean position of these areas (left is positive), divided by half the width of the field of view.
    """
    red, _, blue = np.moveaxis(observation["eyes"][:, -1, 0, :, 0], 1, 0)
    prey = np.clip(blue - red - 0.05, 0, None)
    leftwards = np.linspace(1, -1, prey.shape[1])
    return 3 * (prey @ leftwards / (prey.sum(1) + 1e-3))[:, None]


class Prey(sim.Task):
    """Runs in any direction without turning: its action is its velocity.

    Running from a predator is rewarded until the prey is caught; all running has a cost.
    """

    model = FIELD
    mounts = (sim.Mount("prey", offset=(0.21, 0, 0)),)
    fidelity = sim.Fidelity(2, bands=4)
    substeps, episode_steps = 2, 40
    others = (sim.Frozen(Predator(), chase),)

    def n_actions(self, model):
        return 2

    def act(self, data, action):
        data.qvel[:2] = PREY_SPEED * action / max(1.0, np.hypot(*action))

    def terminated(self, data):
        return np.hypot(*from_predator(data)) < CAUGHT

    def rewards(self, data):
        away, run = from_predator(data), data.qvel[:2] / PREY_SPEED
        distance = np.hypot(*away)
        flight = run @ away / distance if distance < 2 * NEAR else 0.0
        return {"flight": flight / self.episode_steps, "effort": -EFFORT * run @ run / self.episode_steps}

    def succeeded(self, data):
        return not self.terminated(data)


class Blindfold(Prey):
    """Null model: the predator belongs to a group of geoms that eyes do not render, and it sees the prey."""

    model = FIELD.replace('group="0"', 'group="3"')

    def __init__(self):
        predator = Predator()
        predator.model = self.model
        self.others = (sim.Frozen(predator, chase),)


def from_predator(data):
    return data.qpos[:2] - data.qpos[2:4]


def always_ahead(episodes=256):
    """Return the mean return, its standard error and the share not caught, for prey that always runs ahead."""
    worlds = sim.make_vec_env(seeing(Prey()), n_envs=episodes, seed=0)
    worlds.reset()
    returns, alive = np.full(episodes, np.nan), np.zeros(episodes)
    while np.isnan(returns).any():
        _, _, done, infos = worlds.step(np.tile([1.0, 0.0], (episodes, 1)))
        for world in np.flatnonzero(done & np.isnan(returns)):
            returns[world], alive[world] = infos[world]["episode"]["r"], infos[world]["is_success"]
    return returns.mean(), returns.std() / episodes**0.5, alive.mean()


def seeing(task):
    """Give the task two eyes, although the policy ignores them."""
    task.eye = optics.Eye(resolution=(1, 12), fov_deg=100, bands=4)
    task.mounts = sim.fan(task.mounts[0], 2, 60)
    return task


def lived(world, placement_range_deg, seed):
    """Return the same results as `always_ahead` for prey that is trained with this angle between its eyes."""
    from rhabdom import evolve
    from rhabdom.evolve.config.assemble import assemble
    from rhabdom.evolve.learning.fitness import evaluate

    here = Path(__file__)
    start = f"genome.placement_range_deg.start={placement_range_deg}"
    config = assemble(f"{here}:{world}", file=here.with_suffix(".toml"), assignments=[start])
    animal = evolve.develop(evolve.Genotype(config.genome).start, config)
    with TemporaryDirectory() as folder:
        life = evaluate(animal, config, seed, Path(folder) / "policy")
    return life.fitness, np.std(life.returns) / len(life.returns) ** 0.5, life.success_rate


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--trainings", type=int, default=0, help="trainings for each placement of eyes in each world")
    told = "{}: fitness {:.3f} ± {:.3f}, {:.0%} not caught".format
    print(told("always ahead", *always_ahead()))
    for number in range(parser.parse_args().trainings):
        for world in ("Prey", "Blindfold"):
            for name, placement in (("front", 30), ("side", 180)):
                print(told(f"{world}, {name}, training {number}", *lived(world, placement, number)), flush=True)
