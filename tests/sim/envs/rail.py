"""A cart on a rail that looks ahead: shared base of the tests with worlds that differ."""

import optics
import sim

EYE = optics.Eye(resolution=(15, 21), fov_deg=80, bands=5, noise_sigma=0.0)


class OnRail(sim.Task):
    """A task on any `model` that has a body "cart" and one actuator."""

    eye = EYE
    mounts = (sim.Mount("cart", offset=(0.2, 0, 0.1)),)
    fidelity = sim.Fidelity(4, bands=5)
    episode_steps, substeps = 3, 2

    def rewards(self, data):
        return {"none": 0.0}
