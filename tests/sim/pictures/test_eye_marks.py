"""Eye marks in renderings, against pinhole geometry."""

import numpy as np

from sim.pictures.eye_marks import COLORS, with_eyes
from sim.scene.cameras import Viewpoint

# the view is along +y, so that +x is to the right
VIEW = Viewpoint.looking_at(np.array([0.0, -4.0, 0.0]), np.zeros(3), 90.0)
AHEAD_RIGHT = np.column_stack([[0.0, -1, 0], [0, 0, 1], [1.0, 0, 0]])  # the eye looks along +x


def drawn(pupil, frame=AHEAD_RIGHT, fov_deg=60.0):
    black = np.zeros((360, 360, 3), np.uint8)
    return with_eyes(black, VIEW, (np.array([pupil]), frame[None]), fov_deg, 1.0).astype(float)


def test_an_eye_is_where_it_is():
    """The image has 90 degrees over 360 pixels. At a distance of 4 m this is 45 pixels per metre."""
    picture = drawn([1.0, 0.0, 0.5])
    rows, columns = np.nonzero(picture.sum(axis=2) > 100)
    assert picture[180 - 23, 180 + 45].sum() < 60  # the black pupil within its iris
    ring = picture[180 - 23 - 3 : 180 - 23 + 4, 180 + 45 - 3 : 180 + 45 + 4].reshape(-1, 3).max(axis=0)
    assert np.all((0.75 * COLORS[0] <= ring) & (ring <= COLORS[0]))  # rims may be painted over the iris
    assert columns.max() > 180 + 45 + 30  # the rims of a field to the right
    assert columns.min() > 180 + 45 - 6  # no rim to the left
    assert np.abs(rows - 157.5).max() < 6  # from the side, both rims lie in the plane of the eye


def test_rims_open_with_the_field():
    """The eye is rolled, so that its field opens across the image. The lines along the edges of the field are 1 m long,
    so their ends are 2 sin(fov / 2) m apart.
    """
    rolled = AHEAD_RIGHT[:, [1, 0, 2]] * [1, -1, 1]
    for fov_deg in (40.0, 80.0):
        rows, _ = np.nonzero(drawn([0.0, 0.0, 0.0], rolled, fov_deg).sum(axis=2) > 100)
        np.testing.assert_allclose(np.ptp(rows), 2 * np.sin(np.radians(fov_deg / 2)) * 45, atol=4)


def test_what_is_behind_the_camera_is_not_drawn():
    assert drawn([0.0, -5.0, 0.0]).sum() == 0
