"""Bodies in the room of the detection task that shade each other."""

import numpy as np

WORLDS = 24
HALF_ROOM = np.array([11.0, 9.0])  # half of the detection room, between its walls [m]


def bodies_of(scene):
    """Return centres (world, body, 3), the agent's last. Bodies are near walls and apart from each other, so that
    lights are often blocked by both.
    """
    radii, rng, found = scene.upright.bodies.radii, np.random.default_rng(4), []
    heights = [*[0.5] * (len(radii) - 1), 0.2]
    room = HALF_ROOM - 0.55
    while len(found) < WORLDS:
        middle = rng.uniform(-1, 1, 2) * room
        axis = rng.integers(2)
        middle[axis] = rng.choice([-1, 1]) * room[axis]
        places = np.clip(middle + rng.uniform(-2, 2, (len(radii), 2)), -room, room)
        apart = np.linalg.norm(places[:, None] - places, axis=-1) - radii[:, None] - radii
        if apart[~np.eye(len(radii), dtype=bool)].min() > 0.05:
            found.append(np.column_stack([places, heights]))
    return np.array(found)
