"""The choice of a fidelity for a built-in world, with stand-ins for the trials of its stages."""

from types import SimpleNamespace

import pytest

import sim
from sim.render import world_fidelity
from sim.render.fidelity import Fidelity, Level
from sim.render.world_fidelity import SHARES, WorldStages, choose_fidelity, chosen_fidelity

WORLD, EYES = sim.build_world("maze"), sim.Eyes(n_eyes=1, resolution=(2, 3))
LEVELS = tuple(Level(stage, "chosen", None, "given") for stage in ("bands", "depth", "light", "rays"))


@pytest.fixture
def stages(monkeypatch):
    """Return a list of the stages among which a fidelity is chosen. Scenes are recorded, but not built."""
    found = []

    def cheapest(of):
        found.append(of)
        return Fidelity(7, of._scene.eyes.bands, levels=LEVELS)

    def scene(world, eyes, tracer="auto"):
        return SimpleNamespace(world=world, eyes=eyes, tracer=tracer, eye=eyes.eye())

    monkeypatch.setattr(world_fidelity, "WorldScene", scene)
    monkeypatch.setattr(world_fidelity, "FidelityTrials", lambda scene: ("trials", scene))
    monkeypatch.setattr(world_fidelity, "cheapest", cheapest)
    return found


def test_own_bands(stages):
    found = choose_fidelity(WORLD, EYES, 0.25, bands="own", tracer="model")
    assert found == Fidelity(7, EYES.bands, levels=LEVELS)
    [one] = stages
    assert (one.allowed, one._scene.world, one._scene.eyes, one._scene.tracer) == (0.25, WORLD, EYES, "model")
    assert one._trials == ("trials", one._scene)


def test_the_fewest_bands_take_their_share_of_the_tolerance(stages, monkeypatch):
    asked, level = [], Level("bands", "5", 0.01, "fewest")
    monkeypatch.setattr(world_fidelity.stages, "bands", lambda *given: asked.append(given) or (5, level))
    found = choose_fidelity(WORLD, EYES, 0.2)
    assert asked == [(EYES.eye(), pytest.approx(0.35 * 0.2), None)]
    assert found == Fidelity(7, 5, levels=(level, *LEVELS[1:]))
    [one] = stages
    assert (one._scene.eyes.bands, one.allowed, one.shares) == (5, 0.2, SHARES)


def test_without_a_tolerance_half_of_the_noise_is_allowed(stages):
    noisy = sim.Eyes(n_eyes=1, resolution=(2, 3), noise_sigma=0.1)
    chosen_fidelity(world_fidelity.WorldScene(WORLD, noisy))
    assert stages[0].allowed == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("maze", EYES), "world = 'maze'"),
        ((WORLD, 3), "eyes = 3"),
        ((WORLD, EYES, -0.1), "tolerance = -0.1"),
    ],
)
def test_bad_arguments_are_named(stages, arguments, reason):
    with pytest.raises(ValueError, match=f"^{reason}"):
        choose_fidelity(*arguments)
    with pytest.raises(ValueError, match=r"^bands = 'few': must be one of 'auto', 'own'$"):
        choose_fidelity(WORLD, EYES, bands="few")


def test_stages_use_the_trials_and_sampling_of_their_scene(stages, monkeypatch):
    scene = SimpleNamespace(
        world="world", eyes=EYES, eye=EYES.eye(), camera_sampling=lambda depth, allowed: ("sampling", depth, allowed)
    )
    one, trials = WorldStages(scene, 0.2), ("trials", scene)
    for name in ("own_bands", "depth", "light"):
        monkeypatch.setattr(world_fidelity.stages, name, lambda *given, name=name: (name, *given))
    monkeypatch.setattr(world_fidelity, "fewest_samples", lambda *given: ("samples", *given))
    sampling = ("sampling", "layers", 0.2)
    assert one.bands() == ("own_bands", "world", scene.eye)
    assert one.depth(0.1) == ("depth", trials, scene.eye, 0.1)
    assert one.light("layers", 0.1) == ("light", trials, sampling, 0.1)
    assert one.samples("layers", "bounce", 0.1) == ("samples", trials, sampling, "bounce", 0.1)
