"""Eyes in front or at the sides? Prey that has two of them evolves where, before a predator that hunts by sight.

    evolve run examples/front_or_side.py:Prey --config examples/front_or_side.toml

The predator is frozen: it has eyes, too, and a rule instead of a brain that learns. It comes from anywhere, or, in
every second episode, not at all, so that whoever sees nothing does not know whether nothing is there. `Unseen` is the null
model: the same predator, which no eye of the prey's sees. Run as a script, the file shows how prey fares that never
moves; `--trainings 3` trains prey with eyes in front and at the sides three times each, in both worlds.
"""

import argparse

import numpy as np

import optics
import sim

PREY_SPEED, PREDATOR_SPEED, TURN = 0.6, 1.0, 2.0  # m/s, m/s, rad/s
FAR, AWAY, CAUGHT = 2.0, 30.0, 0.4  # m: where the predator begins, if it comes; if not; from middle to middle
EFFORT = 0.4  # of an episode's worth: of running all the time
PREY, PREDATOR = slice(0, 2), slice(2, 5)  # of qpos and qvel

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
      <geom size=".25" rgba=".9 .1 .1 1"/>
    </body>
  </worldbody>
</mujoco>"""


class Predator(sim.Task):
    """Runs ahead at full speed; its action is where to turn."""

    model = FIELD
    eye = optics.Eye(resolution=(1, 15), fov_deg=100, bands=4)
    mounts = (sim.Mount("predator", offset=(0.26, 0, 0)),)
    fidelity = sim.Fidelity(2, bands=4)
    substeps, episode_steps = 2, 40

    def reset(self, data, rng):
        comes, bearing = rng.random() < 0.5, rng.uniform(-np.pi, np.pi)
        place = (FAR if comes else AWAY) * np.array([np.cos(bearing), np.sin(bearing)])
        data.qpos[PREDATOR] = *place, bearing + np.pi

    def n_actions(self, model):
        return 1

    def act(self, data, action):
        heading = data.qpos[4]
        data.qvel[PREDATOR] = PREDATOR_SPEED * np.cos(heading), PREDATOR_SPEED * np.sin(heading), TURN * action[0]


def chase(observation):
    """Turn to where things are blue: the middle of what is, in parts of the field, left positive."""
    red, _, blue = np.moveaxis(observation["eyes"][:, -1, 0, :, 0], 1, 0)
    prey = np.clip(blue - red - 0.05, 0, None)
    to_the_left = np.linspace(1, -1, prey.shape[1])
    return 3 * (prey @ to_the_left / (prey.sum(1) + 1e-3))[:, None]


class Prey(sim.Task):
    """Runs in any direction without turning: its action is its velocity. To be alive is worth 1 an episode, to be
    caught -1, and running costs."""

    model = FIELD
    mounts = (sim.Mount("prey", offset=(0.21, 0, 0)),)
    fidelity = sim.Fidelity(2, bands=4)
    substeps, episode_steps = 2, 40
    others = (sim.Frozen(Predator(), chase),)

    def n_actions(self, model):
        return 2

    def act(self, data, action):
        data.qvel[PREY] = PREY_SPEED * action / max(1.0, np.hypot(*action))

    def terminated(self, data):
        return np.hypot(*(data.qpos[PREY] - data.qpos[PREDATOR][:2])) < CAUGHT

    def rewards(self, data):
        effort = EFFORT * np.sum(data.qvel[PREY] ** 2) / PREY_SPEED**2
        return {
            "alive": 1 / self.episode_steps,
            "effort": -effort / self.episode_steps,
            "caught": -float(self.terminated(data)),
        }

    def succeeded(self, data):
        return not self.terminated(data)


class Unseen(Prey):
    """The null model: the predator is of a group of geoms that no eye sees. It sees the prey."""

    model = FIELD.replace('rgba=".9', 'group="3" rgba=".9')
    others = ()

    def __init__(self):
        predator = Predator()
        predator.model = self.model
        self.others = (sim.Frozen(predator, chase),)


def fared(task, policy, episodes=256):
    """Returns (mean, standard error) and the share of those who were not caught."""
    worlds = sim.make_vec_env(task, n_envs=episodes, seed=1000)
    observation, playing = worlds.reset(), np.ones(episodes, bool)
    returns, alive = np.zeros(episodes), np.ones(episodes, bool)
    for _ in range(task.episode_steps):
        observation, reward, done, infos = worlds.step(policy(observation))
        returns += reward * playing
        alive &= ~playing | [info["is_success"] for info in infos]
        playing &= ~done
    worlds.close()
    return returns.mean(), returns.std() / episodes**0.5, alive.mean()


def with_eyes(world, placement_range_deg):
    """The task for prey whose two eyes are so far apart."""
    task = world()
    task.eye = optics.Eye(resolution=(1, 12), fov_deg=120, bands=4)
    task.mounts = sim.fan(Prey.mounts[0], 2, placement_range_deg)
    return task


def trained(task, seed, steps):
    """How a prey fares that has learnt."""
    from stable_baselines3 import PPO

    lessons = sim.make_vec_env(task, n_envs=32, seed=seed)
    settings = {"n_steps": 64, "batch_size": 512, "n_epochs": 8, "learning_rate": 1e-3, "gamma": 0.97}
    learner = PPO("MultiInputPolicy", lessons, seed=seed, **settings).learn(steps)
    lessons.close()
    return fared(task, lambda observation: learner.predict(observation, deterministic=True)[0])


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--trainings", type=int, default=0, help="of each kind of eyes in each world")
    parser.add_argument("--steps", type=int, default=40_000, help="of a training")
    arguments = parser.parse_args()
    still = fared(with_eyes(Prey, 60), lambda observation: np.zeros((256, 2)))
    print(f"prey that never moves: return {still[0]:.2f} ± {still[1]:.2f}, {still[2]:.0%} live")
    for world in (Prey, Unseen):
        for name, placement in (("front", 30), ("side", 180)):
            for seed in range(arguments.trainings):
                mean, error, alive = trained(with_eyes(world, placement), seed, arguments.steps)
                print(f"{world.__name__}, {name}, seed {seed}: {mean:.2f} ± {error:.2f}, {alive:.0%} live", flush=True)
