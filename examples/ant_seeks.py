"""An ant with evolving eyes that walks by sight to a red ball at a random position around it.

    evolve run examples/ant_seeks.py:AntSeeks --preset quick

The body is Gymnasium's ant, from the installed package. The ant learns where to go. Its gait is programmed: a trot of
diagonal legs, whose phase the task stores in mjData's `userdata`. Observations are the eyes' signals and the last
action, without the state of the legs.

Run as a script, the file prints how fast the ant walks and turns, and how often a randomly walking ant reaches the
ball.
"""

from pathlib import Path

import gymnasium
import mujoco
import numpy as np

from rhabdom import sim

ANT = Path(gymnasium.__file__).parent / "envs/mujoco/assets/ant.xml"
SIDES = np.array([1, 1, -1, -1])  # left or right, in the model's order of legs
OUTWARDS = np.array([1, -1, -1, 1])  # sign of the knee that bends a leg down
TROT = np.array([0.0, np.pi, 0.0, np.pi])  # diagonal legs step together
STRIDE, LIFT, STANCE = 0.52, 0.3, 1.1  # [rad]: swing of the hip, lift of the knee, knee on the ground
NEAR = 1.0  # [m] from the ball's centre: the ant's feet touch it


def ant_and_ball(seen: bool = True) -> mujoco.MjSpec:
    """Return Gymnasium's ant with position-controlled joints, on a plain floor, and a ball."""
    spec = mujoco.MjSpec.from_file(str(ANT))
    spec.nuserdata, spec.option.timestep = 2, 0.02
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.visual.headlight.active = 0
    for actuator in list(spec.actuators):
        spec.delete(actuator)
    for name in [f"{joint}_{leg}" for leg in range(1, 5) for joint in ("hip", "ankle")]:
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_position(kp=60.0, kv=6.0)
    for texture in list(spec.textures):
        if texture.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX:
            spec.delete(texture)
    floor = spec.geom("floor")
    floor.material, floor.rgba = "", [0.3, 0.3, 0.3, 1]
    spec.lights[0].dir = [-0.3, -0.4, -1]
    ball = spec.worldbody.add_body(name="ball", mocap=True, pos=[2, 0, 0.5])
    ball.add_geom(name="ball", size=[0.5, 0, 0], rgba=[0.9, 0.15, 0.1, float(seen)], contype=0, conaffinity=0)
    tilt = np.radians(48) / 2
    spec.worldbody.add_camera(name="watch", pos=[0, -5, 4.5], quat=[np.cos(tilt), np.sin(tilt), 0, 0], fovy=55)
    return spec


class AntSeeks(sim.Task):
    """A ball is 2 to 3 m away in any direction. The action sets the ant's speed and its turn."""

    model = ant_and_ball()
    mounts = (sim.Mount("torso", offset=(0.27, 0, 0.1)),)
    fidelity = sim.Fidelity(2, bands=4)
    camera = "watch"  # for rendered images
    substeps, episode_steps = 10, 45  # of 0.02 s and of 0.2 s

    def n_actions(self, model):
        return 2

    def act(self, data, action):
        """Move the legs for a speed, from -1 (standing) to 1 (full), and a turn, positive to the left.

        Strides shorten as the ant turns.
        """
        speed, turn = (action[0] + 1) / 2, action[1]
        data.userdata[0] += 2 * np.pi * self.substeps * data.model.opt.timestep  # one stride per second
        phase = data.userdata[0] + TROT
        stride = STRIDE * (speed * (1 - abs(turn)) * SIDES - turn)
        lift = LIFT * max(speed, abs(turn)) * np.clip(-np.sin(phase), 0, None)
        data.ctrl[0::2], data.ctrl[1::2] = -stride * np.cos(phase), OUTWARDS * (STANCE - lift)

    def reset(self, data, rng):
        data.qpos[2], data.qpos[8::2] = 0.6, OUTWARDS * STANCE
        around, far = rng.uniform(-np.pi, np.pi), rng.uniform(2, 3)
        data.mocap_pos[0, :2] = far * np.cos(around), far * np.sin(around)
        data.userdata[:] = rng.uniform(0, 2 * np.pi), self.apart(data)

    def rewards(self, data):
        before, data.userdata[1] = data.userdata[1], self.apart(data)
        return {"nearer": before - data.userdata[1], "there": float(self.terminated(data))}

    def terminated(self, data):
        return self.apart(data) < NEAR

    def succeeded(self, data):
        return self.terminated(data)

    def apart(self, data):
        """Return the distance to the ball [m]."""
        return float(np.linalg.norm(data.mocap_pos[0, :2] - data.qpos[:2]))


class Blindfold(AntSeeks):
    """Null model: the same ant and the same ball, which is invisible."""

    model = ant_and_ball(seen=False)


def walk(speed: float, turn: float, seconds: float = 6.0) -> tuple[float, float]:
    """Return the speed [m/s] and turning rate [rad/s] of an ant with a constant action."""
    task = AntSeeks()
    model = task.model.compile()
    data, headings = mujoco.MjData(model), []
    task.reset(data, np.random.default_rng(0))
    for _ in range(round(5 * seconds)):
        task.act(data, np.array([speed, turn]))
        mujoco.mj_step(model, data, task.substeps)
        ahead = data.body("torso").xmat.reshape(3, 3)[:, 0]
        headings.append(np.arctan2(ahead[1], ahead[0]))
    return float(np.hypot(*data.qpos[:2])) / seconds, float(np.ptp(np.unwrap(headings))) / seconds


if __name__ == "__main__":
    print(f"straight on: {walk(1, 0)[0]:.2f} m/s · on the spot: {walk(-1, 1)[1]:.2f} rad/s")
    random = np.random.default_rng(0)
    worlds = sim.make_vec_env(AntSeeks(), n_envs=32, seed=0)
    worlds.reset()
    done, found = np.zeros(32, bool), np.zeros(32, bool)
    way = random.uniform(-1, 1, (32, 2))
    for _ in range(AntSeeks.episode_steps):
        way = 0.9 * way + 0.1 * random.uniform(-1, 1, (32, 2))
        _, _, ended, infos = worlds.step(way)
        found |= ~done & [info["is_success"] for info in infos]
        done |= ended
    print(f"ants that walk at random reach the ball in {found.mean():.0%} of their episodes")
