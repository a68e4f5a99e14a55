"""Questionable settings are named: genes and starts without effect, and too few bands for the colours of a world."""

from evolve.config.assemble import assemble
from evolve.config.lint import idle_genes, idle_settings, idle_starts, lint


def test_genes_that_cannot_change_anything_are_named():
    def notes(*settings):
        return idle_genes(assemble("detection", assignments=settings))

    assert notes() == []
    assert "placement_range_deg is open but has no effect" in notes("genome.n_eyes.open=false")[0]
    assert notes("genome.n_eyes.open=false", "genome.n_eyes.start=3") == []
    glass = ("genome.refractive_index.open=false", "genome.refractive_index.start=1")
    assert "refractive_index is fixed at 1" in notes(*glass)[0]
    assert "the relief is fixed and flat" in notes("genome.doe.open=false")[0]
    assert notes("genome.doe.open=false", "genome.doe_11.start=0.9") == []
    inherited = ("eye.receptors=genes", "genome.lambda_max.open=true")
    first, *others = notes(*inherited)
    assert "the world of detection is grey" in first
    assert not any("grey" in note for note in notes(*inherited, "world.medium=clear_ocean")), "water colours the light"
    assert others == ["genome.lambda_max_3_nm is open but has no effect: genome.receptor_types is at most 3"]
    assert len(notes(*inherited, "genome.receptor_types.open=true")) == 1


def test_starts_that_nothing_reads_are_named():
    def notes(*settings):
        return idle_starts(assemble("detection", assignments=settings))

    assert notes() == notes("eye.optics=false") == []
    blue = "genome.lambda_max_0_nm.start=400"
    assert notes(blue) == ["the start of lambda_max_0_nm has no effect: eye.receptors = rgb, not genes"]
    assert notes(blue, "eye.receptors=genes") == []
    closed = ("eye.optics=false", "genome.relative_aperture.start=0.2", "genome.refractive_index.start=1.7")
    assert notes(*closed) == ["the start of relative_aperture, refractive_index has no effect: eye.optics = false"]
    relief = [f"genome.doe_{i}{j}.start=0.1" for i in range(4) for j in range(4)]
    assert "doe_00, doe_01, doe_02, ... has no effect" in notes("eye.optics=false", *relief)[0]


def test_bands_too_few_for_the_colours_of_a_world_are_named():
    """Four bands are so wide that the ultraviolet light of a goal appears in the range of a pigment of 410 nm, with an
    error of 0.18 of white's signal.
    """

    def notes(task, *settings):
        return lint(assemble(task, assignments=settings))

    few = "eye.bands = 4: signals of foraging's objects have errors up to 0.065 of white's signal, more than "
    assert notes("foraging") == [few + "a receptor's noise, 0.01; 16 bands are enough"]
    narrow = ("genome.relative_aperture.open=false", "genome.relative_aperture.start=0.3")
    assert notes("foraging", *narrow) == [], "in a tenth of the light"
    assert notes("foraging", "eye.bands=16") == []
    inherited = ("eye.receptors=genes", "eye.noise_sigma=0.02", "genome.lambda_max_2_nm.open=true")
    assert "up to 0.18 of white's signal" in notes("foraging", *inherited)[0]
    assert notes("foraging", *inherited, "eye.bands=16") == []
    assert "more than a receptor's noise, 0.001; 32 bands are enough" in notes("foraging", "eye.noise_sigma=0")[0]
    assert (
        "even 40 bands are not enough"
        in notes("foraging", "eye.receptors=honeybee", "eye.bands=40", "eye.noise_sigma=0")[0]
    )
    assert notes("detection", "eye.bands=1") == [], "a grey world has no colours to misrepresent"


def test_settings_that_nothing_reads_are_named():
    def notes(*settings):
        return idle_settings(assemble("detection", assignments=settings))

    assert notes() == notes("eye.optics=false") == notes("genome.optical.opens_at=3") == []
    held = "genome.layers.opens_at=2"
    assert notes(held) == ["genome.layers.opens_at has no effect: the gene is frozen; set genome.layers.open = true"]
    assert notes(held, "genome.layers.open=true") == []
    assert notes("search.promoted=0.3") == ["search.promoted has no effect: search.rungs = 1"]
    assert notes("search.promoted=0.3", "search.rungs=2") == []
    assert notes("search.active=true") == []
    assert notes("search.active=true", "search.optimizer=mutation") == [
        "search.active has no effect: search.optimizer = mutation"
    ]
    assert notes("eye.optics=false", "eye.relief_height=2e-6") == [
        "eye.relief_height has no effect: eye.optics = false"
    ]
