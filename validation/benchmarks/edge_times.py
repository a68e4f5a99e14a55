"""Adaptive edge sampling compared with uniform sampling, in one process: `python -m validation.benchmarks.edge_times`.

The table shows errors in units of the receptors' noise over those receptors for which one ray is not enough, and
medians of CPU time of one thread for the signals of 32 worlds. In the first world, a ball in the dark, few receptors
see a rim. In the second, with textured objects, few receptors see no edge.
"""

from __future__ import annotations

import time

import drjit as dr
import mujoco
import numpy as np

import optics
import sim

WORLDS, LOOKS, WARM_UP = 32, 7, 2
TRUE, SIGMA, APART = 2048, 0.01, 0.05  # rays of the reference; noise relative to white; error [σ] at an edge
EYE = optics.Eye(resolution=(15, 15), fov_deg=50, bands=4, noise_sigma=SIGMA)
FIDELITIES = [sim.Fidelity(n, EYE.bands, samples=how) for how in ("rays", "edges") for n in (16, 64, 128)]
BALL = """
<mujoco><visual><headlight active="0"/></visual><worldbody>
  <light type="directional" dir=".2 .3 -1" diffuse=".9 .9 .9"/>
  <body name="head"><geom size=".1" rgba="0 0 0 1"/></body>
  <body name="ball" pos="3 0 0"><joint type="slide" axis="0 1 0"/><joint type="slide" axis="0 0 1"/>
    <geom size=".4" rgba="1 1 1 1"/></body>
</worldbody></mujoco>"""
THINGS = """
<mujoco><visual><headlight active="0"/></visual>
  <asset>
    <texture name="t" type="2d" builtin="checker" width="32" height="32" rgb1=".9 .3 .1" rgb2=".1 .3 .8"/>
    <material name="t" texture="t" texrepeat="4 4"/>
  </asset>
  <worldbody>
    <light type="directional" dir="-.3 .5 -1" diffuse=".6 .6 .6"/>
    <geom type="plane" size="4 4 .1" material="t"/>
    <geom type="box" size=".4 .3 .5" pos="1 .4 .5" rgba=".8 .7 .2 1"/>
    <body name="head" pos="-3 0 1"><geom size=".1"/></body>
    <body pos="0 0 .8"><joint axis="0 0 1"/>
      <geom type="capsule" fromto="0 0 0 .8 0 .2" size=".12" rgba=".2 .7 .3 1"/>
      <geom type="ellipsoid" size=".2 .3 .25" pos=".9 0 .3" rgba=".7 .2 .6 1"/></body>
  </worldbody>
</mujoco>"""


def moments(model: mujoco.MjModel) -> list[mujoco.MjData]:
    """Return states with random joint positions."""
    random, found = np.random.default_rng(0), []
    for _ in range(WORLDS):
        data = mujoco.MjData(model)
        data.qpos[:] = random.uniform(-1, 1, model.nq)
        mujoco.mj_forward(model, data)
        found.append(data)
    return found


def rows(name: str, text: str) -> list[str]:
    """Return the table rows for one world."""
    model = mujoco.MjModel.from_xml_string(text)
    datas, mount = moments(model), sim.Mount("head", offset=(0.2, 0, 0))

    def renderer(fidelity: sim.Fidelity) -> sim.ModelRenderer:
        return sim.ModelRenderer(model, EYE, [mount], WORLDS, fidelity)

    true, one = (renderer(sim.Fidelity(n, EYE.bands)).signals(datas) for n in (TRUE, 1))
    apart = np.abs(one - true).max(axis=2) > APART * SIGMA
    found = []
    for fidelity in FIDELITIES:
        looker, spent = renderer(fidelity), []
        for _ in range(WARM_UP + LOOKS):
            start = time.process_time()
            seen = looker.signals(datas)
            spent.append(1e3 * (time.process_time() - start))
        off = np.abs(seen - true).max(axis=2) / SIGMA
        error, ms = np.sqrt(np.mean(off[apart] ** 2)), np.median(spent[WARM_UP:])
        where = f"{fidelity.rays_per_receptor} {'everywhere' if fidelity.samples == 'rays' else 'at edges'}"
        found.append(f"| {name} ({apart.mean():.0%}) | {where} | {error:.2f} | {off.max():.1f} | {ms:.1f} |")
    return found


def main() -> None:
    """Print a row for each world and fidelity."""
    dr.set_thread_count(1)
    print("| world (receptors that see an edge) | rays | error [σ] | worst [σ] | CPU [ms] |")
    print("|---|---|---|---|---|")
    print("\n".join([*rows("a ball in the dark", BALL), *rows("textured objects", THINGS)]))


if __name__ == "__main__":
    main()
