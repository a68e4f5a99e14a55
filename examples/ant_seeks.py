"""An ant with eyes that evolve, and that goes by sight to a red ball somewhere around it.

    evolve run examples/ant_seeks.py:AntSeeks --preset quick

The body is Gymnasium's ant, as it is installed with it. What is learnt is where to go. How its legs take it there is
written down here: a trot of diagonal legs, whose phase the task keeps in mjData's `userdata`. The animal knows what its
eyes see and what it did last, and nothing of its legs.

Run as a script, the file shows how fast the ant walks and turns, and how often it comes to a ball that it cannot see.
"""

from pathlib import Path

import gymnasium
import mujoco
import numpy as np

import sim

ANT = Path(gymnasium.__file__).parent / "envs/mujoco/assets/ant.xml"
SIDES = np.array([1, 1, -1, -1])  # left or right, of the legs as the model numbers them
OUTWARDS = np.array([1, -1, -1, 1])  # sign of the knee that bends a leg down
TROT = np.array([0.0, np.pi, 0.0, np.pi])  # diagonal legs step together
STRIDE, LIFT, STANCE = 0.52, 0.3, 1.1  # [rad] of the hip to either side; of the knee in the air, and on the ground
NEAR = 1.0  # [m] from the ball's centre: the ant's feet touch it


def ant_and_ball(seen: bool = True) -> mujoco.MjSpec:
    """Gymnasium's ant with joints that are led to angles, on a plain floor, and a ball."""
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
    """A ball is 2 to 3 m away, anywhere around. The ant says how fast it walks, and how it turns."""

    model = ant_and_ball()
    mounts = (sim.Mount("torso", offset=(0.27, 0, 0.1)),)
    fidelity = sim.Fidelity(2, bands=4)
    camera = "watch"  # of pictures for people
    substeps, episode_steps = 10, 45  # of 0.02 s, and of 0.2 s

    def n_actions(self, model):
        return 2

    def act(self, data, action):
        """Speed, -1 standing and 1 full, and turning, to the left above 0; who turns strides less."""
        speed, turn = (action[0] + 1) / 2, action[1]
        data.userdata[0] += 2 * np.pi * self.substeps * data.model.opt.timestep  # a stride in a second
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
        """How far the ball is [m]."""
        return float(np.linalg.norm(data.mocap_pos[0, :2] - data.qpos[:2]))


class Blindfold(AntSeeks):
    """The null model: the same ant and the same ball, which cannot be seen."""

    model = ant_and_ball(seen=False)


def walk(speed: float, turn: float, seconds: float = 6.0) -> tuple[float, float]:
    """How fast an ant that does this gets ahead [m/s], and turns [rad/s]."""
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
    print(f"ants that stroll about come to the ball in {found.mean():.0%} of their episodes")
