"""Walls in closed form against Mitsuba's ray tracing of the same scene, ray by ray."""

import dataclasses
from types import SimpleNamespace

import drjit as dr
import mitsuba as mi
import mujoco
import numpy as np
import pytest

import sim
from sim.eyes.eyes import BODY_RADIUS
from sim.eyes.sampling import BoxSampling
from sim.render.fidelity_trials import FidelityTrials
from sim.render.populations import near_objects
from sim.render.world_scene import WorldScene
from sim.scene.variant import variant
from sim.tasks.registry import task_of
from sim.tasks.simulation import Simulation
from sim.tracing import closed_form_tracer, spheres
from sim.tracing.light_components import components_of, reflected_components_of
from sim.tracing.reflectance_atlas import bake
from sim.tracing.wall_intersection import Cells
from sim.worlds.layout import Starts
from sim.worlds.world import build_world

EYES = sim.Eyes(n_eyes=3, resolution=(9, 12), fov_deg=70, placement_range_deg=240, bands=5, noise_sigma=0)
FOUR_RAYS = sim.Fidelity(4, EYES.bands)


def scattered(world, n, seed=0):
    """Return a state with agents at random positions and headings, and objects around them."""
    rng = np.random.default_rng(seed)
    state = Simulation(task_of(world), n, seed).reset()
    places = world.agent_spawn if not world.objects else np.concatenate([world.agent_spawn, world.object_spawn])
    shift = rng.uniform(-0.6, 0.6, (n, 2))
    position = places[rng.integers(len(places), size=n)] + shift
    return dataclasses.replace(state, position=position, heading=rng.uniform(-np.pi, np.pi, n))


def radiances(world, state):
    """Return the radiance along every ray by both tracers, (ray, band)."""
    return [
        sim.BatchedRenderer(world, EYES, state.n, FOUR_RAYS, name).radiance(state).reshape(-1, EYES.bands)
        for name in ("closed_form", "mitsuba")
    ]


@pytest.mark.parametrize(
    ("task", "seed", "mazes"),
    [
        ("detection", 0, 1),
        ("tracking", 1, 1),
        ("navigation", 0, 1),
        ("maze", 8, 5),
        *(("maze", seed, 1) for seed in range(3)),
    ],
)
def test_every_ray_sees_what_mitsuba_sees(monkeypatch, task, seed, mazes):
    """All rays agree to float32, except for the few that graze an edge of a stripe, a wall or a shadow.

    Shadow rays start at Mitsuba's distance here. Otherwise, the edges of shadows would differ by millimetres.
    """
    monkeypatch.setattr(closed_form_tracer, "CLEARANCE", 1)
    world = build_world(task, seed=seed, mazes=mazes)
    ours, theirs = radiances(world, scattered(world, 24, seed))
    different = np.abs(ours - theirs).max(axis=1) > 2e-3
    assert different.mean() < 1e-3
    assert theirs.std() > 0.03


BOXES = """<mujoco><asset>
 <texture name="t" type="2d" builtin="checker" width="16" height="8" rgb1=".9 .2 .1" rgb2=".1 .3 .8"/>
 <texture name="s" type="2d" builtin="gradient" width="32" height="32" rgb1=".9 .8 .1" rgb2=".1 .1 .2"/>
 <material name="t" texture="t" texrepeat="3 2"/><material name="u" texture="s" texrepeat="2 1" texuniform="true"/>
 </asset><visual><headlight active="0"/></visual><worldbody>
 <light type="directional" dir="1 .4 -.7" diffuse=".9 .5 .2" ambient="0 0 0" specular="0 0 0"/>
 <light type="directional" dir="-.3 -1 -.6" diffuse=".2 .4 .9" ambient="0 0 0" specular="0 0 0"/>
 <geom type="plane" size="9 8 1" material="{floor}"/>
 {boxes}
 <body name="agent" pos="0 0 .2"><joint name="agent_x" type="slide" axis="1 0 0"/>
 <joint name="agent_y" type="slide" axis="0 1 0"/><joint name="agent_heading" axis="0 0 1"/><geom size=".2"/></body>
 <body name="goal" mocap="true" pos="1 1 .5"><geom size=".5" material="t"/></body>
 </worldbody></mujoco>"""


def furnished(n_boxes, *, grid, floor="t", extra="", seed=0):
    """Return a world with coloured walls of random sizes and heights, textured along both axes, rotated by multiples of
    90°.
    """
    rng = np.random.default_rng(seed)
    boxes = []
    for i in range(n_boxes):
        angle = 2 * np.pi * (i + 0.5) / n_boxes
        x, y = 5.5 * np.cos(angle), 5.5 * np.sin(angle)
        # Walls are on a grid of half metres, in alternate cells, or at random positions.
        half = np.array([0.25, 0.25]) if grid else rng.uniform(0.1, 0.9, 2)
        if grid:
            x, y = np.floor(2 * x) / 2 + 0.25, np.floor(2 * y) / 2 + 0.25
        height = rng.uniform(0.3, 1.5)
        turn = ("0", "90", "180", "270")[rng.integers(4)]
        boxes.append(
            f'<geom type="box" pos="{x} {y} {height / 2}" size="{half[0]} {half[1]} {height / 2}" '
            f'euler="0 0 {turn}" material="{"tu"[i % 2]}"/>'
        )
    model = mujoco.MjModel.from_xml_string(BOXES.format(boxes="".join(boxes) + extra, floor=floor))
    spots = np.array([[0.0, 0.0], [1.0, -1.0], [-1.5, 0.5]])
    return sim.World(
        "detection", model, ("goal",), Starts(spots), np.array([[2.0, 2.0], [-2.0, -2.0], [2.0, -2.0]]), None
    )


def around(world, n, seed):
    """Return a state with agents at the world's spawn points, and the goal near them at random."""
    rng = np.random.default_rng(seed)
    template = Simulation(task_of(build_world("detection")), n, 0).reset()
    goal = np.concatenate([rng.uniform(-3, 3, (n, 1, 2)), np.full((n, 1, 1), 0.5)], axis=-1)
    position = world.agent_spawn[rng.integers(len(world.agent_spawn), size=n)]
    return dataclasses.replace(template, position=position, heading=rng.uniform(-3, 3, n), objects=goal)


@pytest.mark.parametrize(("n_boxes", "grid", "seed"), [(6, False, 0), (7, False, 1), (12, True, 2), (14, True, 3)])
def test_coloured_walls_of_any_height_under_coloured_lights(n_boxes, grid, seed):
    world = furnished(n_boxes, grid=grid, seed=seed)
    renderer = sim.BatchedRenderer(world, EYES, 1, sim.Fidelity(1, EYES.bands))
    assert renderer.tracer.name == "closed_form"
    assert ("grid" in renderer.tracer.why) == grid
    ours, theirs = radiances(world, around(world, 32, seed))
    assert (np.abs(ours - theirs).max(axis=1) > 2e-3).mean() < 2e-3
    assert theirs.std() > 0.03


@pytest.mark.parametrize(
    ("extra", "reason"),
    [
        ('<geom name="odd" type="capsule" pos="2 0 .5" size=".2 .5"/>', "'odd' is neither a plane nor a box"),
        ('<geom name="odd" type="box" pos="2 0 .5" size=".2 .5 .5" euler="0 0 30"/>', "'odd' is not aligned"),
        ('<geom type="box" pos="2 0 .9" size=".2 .5 .5"/>', "does not stand on the floor"),
        ('<geom type="box" pos="2 0 .05" size=".2 .5 .05"/>', "ends below the eyes"),
        ('<geom type="plane" pos="0 0 .01" size="1 1 1"/>', "2 floors"),
        ('<geom type="box" pos="8.9 0 .5" size=".5 .5 .5"/>', "beyond the floor"),
        ('<light type="directional" dir="0 .1 1" ambient="0 0 0"/>', "from below"),
    ],
)
def test_other_worlds_are_left_to_mitsuba(extra, reason):
    world = furnished(3, grid=False, extra=extra)
    tracer = sim.BatchedRenderer(world, EYES, 1, sim.Fidelity(1, EYES.bands)).tracer
    assert tracer.name == "mitsuba"
    assert reason in tracer.why
    with pytest.raises(ValueError, match="closed_form.*" + reason):
        sim.BatchedRenderer(world, EYES, 1, tracer="closed_form")


def test_unknown_tracers_are_refused():
    with pytest.raises(ValueError, match="tracer = 'embree'"):
        sim.BatchedRenderer(build_world("detection"), EYES, 1, tracer="embree")


def test_the_atlas_holds_mitsubas_reflectances():
    """Reflectances agree at the texels' centres and between them, for a texture with colours along both axes."""
    world = furnished(2, grid=False)
    stage = WorldScene(world, EYES)
    wavelengths = EYES.eye().spectral_bands.wavelengths
    with variant(stage.variant):
        geom = stage.scene.geoms[1]
        atlas = bake(world.model, [geom], [stage.upright.bsdfs[geom]], wavelengths)
        uv = np.random.default_rng(0).uniform(-2, 3, (2, 500)).astype(np.float32)
        si = dr.zeros(mi.SurfaceInteraction3f, 500)
        si.uv, si.wi, si.wavelengths = (
            mi.Point2f(uv),
            mi.Vector3f(0, 0, 1),
            mi.Spectrum(*(1e9 * wavelengths[:4]).tolist()),
        )
        expected = np.array(stage.upright.bsdfs[geom].eval_diffuse_reflectance(si, True)).T
    first, columns, rows = atlas.places[0]
    x, y = atlas.to_texels[0] @ np.vstack([uv, np.ones(500)])
    table = atlas.texels[first : first + rows * columns].reshape(rows, columns, -1)[..., :4]
    i, j = np.floor(y).astype(int), np.floor(x).astype(int)
    fx, fy = (x - j)[:, None], (y - i)[:, None]
    taps = [table[(i + a) % rows, (j + b) % columns] for a in (0, 1) for b in (0, 1)]
    found = (1 - fy) * ((1 - fx) * taps[0] + fx * taps[1]) + fy * ((1 - fx) * taps[2] + fx * taps[3])
    np.testing.assert_allclose(found, expected, atol=2e-4)  # Mitsuba's coordinates are float32


def test_as_many_components_as_independent_spectra():
    rng = np.random.default_rng(0)
    grey = rng.random((50, 1)) * np.ones(6)
    daylight = np.array([[1.0], [0.5], [0.2]]) * rng.random(6)
    two = rng.random((50, 2)) @ rng.random((2, 6))
    for texels, lights, rank in ((grey, daylight, 1), (two, daylight, 2), (two, rng.random((3, 6)), 6)):
        c = components_of(texels, lights)
        assert len(c.basis) == rank
        found = np.einsum("tk,lk,kb->tlb", c.reflectance, c.levels, c.basis)
        np.testing.assert_allclose(found, texels[:, None] * lights / np.pi, rtol=1e-5, atol=1e-6)


def test_a_cell_beyond_any_side_of_the_grid_is_outside():
    """Otherwise a ray that leaves the field would read a wall height outside the grid."""
    grid = SimpleNamespace(_columns=3, _rows=2)
    with variant():
        column, row = mi.Int32([0, 2, -1, 3, 0, 0]), mi.Int32([0, 1, 0, 0, -1, 2])
        inside = Cells._inside(grid, column, row).numpy()
    assert inside.tolist() == [True, True, False, False, False, False]


def test_components_of_greys_are_their_reflectances():
    """A grey texel's reflectance satisfies radiance / irradiance = reflectance / π."""
    texels, light = np.repeat([[0.2], [0.5], [0.9]], 4, axis=1), np.array([[1.0, 2.0, 3.0, 1.5]])
    few = reflected_components_of(texels, light)
    assert few.basis.shape == (1, 4)
    np.testing.assert_allclose(few.reflectance, texels[:, :1], rtol=1e-6)
    radiance = few.reflectance @ np.diag(few.levels[0]) @ few.basis
    np.testing.assert_allclose(radiance, texels * light / np.pi, rtol=1e-6)


def test_shadows_end_where_the_body_does():
    """An agent in a maze, 35 m from the origin, sees the shadow of its own body. The edge of the shadow is that of the
    sphere, to 0.3 mm. If shadow rays started at Mitsuba's distance from surfaces, it would be off by up to 3 mm.
    """
    scene = WorldScene(build_world("maze"), dataclasses.replace(EYES, fov_deg=100), "closed_form")
    trials = FidelityTrials(scene)
    views, rays = trials._views, trials._everywhere
    trial = BoxSampling(scene.eye).trial(32, rays.receptors)
    origins, directions = views.in_agents(scene.eyes, trial.directions)

    def light():
        components, z = trials._trace(views, trial, "direct")
        return np.abs(components[0].numpy()).reshape(len(views), -1), z.numpy().reshape(len(views), -1)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(closed_form_tracer.spheres, "blocks", lambda *_: False)
        free, _ = light()

    def wrong():
        """Return the number of rays that are shaded outside the shadow, by more than 0.3 mm."""
        found, z = light()
        seen = np.isfinite(z)
        points = origins[:, None] + directions * (np.where(seen, z, 0) / trial.directions[:, 2])[..., None]
        way = views.agents[:, None] - points
        inside, close = np.zeros(z.shape, bool), np.zeros(z.shape, bool)
        for lamp in scene.tracers.tracer_for("direct").lights:
            ahead = way @ lamp.direction
            beside = np.linalg.norm(way - ahead[..., None] * lamp.direction, axis=-1)
            inside |= (ahead > 0) & (beside < BODY_RADIUS)
            close |= np.abs(beside - BODY_RADIUS) < 3e-4
        shaded = found < free * (1 - 1e-4)
        # A lamp may be behind the surface. Rays inside the shadow of such a lamp are not darker.
        return int((shaded & ~inside & ~close & seen).sum())

    assert wrong() == 0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(closed_form_tracer, "CLEARANCE", 1)
        assert wrong() > 20


def test_distant_spheres_do_not_shade_themselves(monkeypatch):
    """Hit points on spheres 20 m away are rounded by more than the distance at which shadow rays start. Of 74,000 rays,
    at most three are darker than with Mitsuba's distance, which is 16 times as long: those at the edges of shadows.
    """
    scene = WorldScene(build_world("detection"), dataclasses.replace(EYES, fov_deg=100), "closed_form")
    trials = FidelityTrials(scene)
    objects = near_objects(scene, BoxSampling(scene.eye), 96, 4096)
    trial = BoxSampling(scene.eye).trial(32, objects.receptors)

    def light():
        return np.abs(trials._trace(objects.views, trial, "direct")[0][0].numpy())

    def darker():
        """Return the number of rays with less light than from Mitsuba's distance."""
        close = light()
        with monkeypatch.context() as patch:
            patch.setattr(closed_form_tracer, "CLEARANCE", 1)
            return int((close < light() - 0.02).sum())

    assert darker() <= 3

    def rounded(bodies, centres, which, hit):
        """Return hit points as they are rounded: a tenth of a millimetre below the surface."""
        point, normal, uv = surface_at(bodies, centres, which, hit)
        return point - normal * 1e-4, normal, uv

    surface_at = spheres.surface_at
    monkeypatch.setattr(closed_form_tracer.spheres, "surface_at", rounded)
    assert darker() > 20
