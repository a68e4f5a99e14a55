"""White under measured lamps, on user models: with few bands, receptors have the quantum catch of the whole
spectrum.
"""

import warnings
from functools import cache

import mujoco
import numpy as np
import pytest

import optics
import sim

NM = np.arange(300.0, 781.0)
LAMPS = {
    "directional": '<light name="lamp" type="directional" dir="1 0 0" diffuse="1 1 1"/>',
    "spot": '<light name="lamp" type="spot" dir="1 0 0" cutoff="80" diffuse="1 1 1" attenuation="0 0 .25"/>',
    "headlight": "",
}
MODEL = """
<mujoco>
  <visual><headlight active="{active}" ambient="0 0 0" diffuse="1 1 1" specular="0 0 0"/></visual>
  <statistic center="2 0 0"/>
  <worldbody>
    {lamp}
    <geom type="box" size=".1 2 2" pos="2.1 0 0" rgba="1 1 1 1"/>
    <body name="eye"><joint type="hinge"/><geom size=".01" pos="0 0 -5"/></body>
  </worldbody>
</mujoco>"""


def model_of(kind):
    return mujoco.MjModel.from_xml_string(MODEL.format(active=int(kind == "headlight"), lamp=LAMPS[kind]))


@cache
def seen(kind, bands, lamp="FL11", receptors="rgb"):
    """Return the signals (channel,) of a small eye that faces a white wall, which faces the lamp."""
    model = model_of(kind)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    eye = optics.Eye(resolution=(1, 1), fov_deg=1, bands=bands, receptors=receptors)
    name = "headlight" if kind == "headlight" else "lamp"
    renderer = sim.ModelRenderer(
        model, eye, [sim.Mount("eye")], 1, sim.Fidelity(1, bands=bands), spectra=None if lamp is None else {name: lamp}
    )
    return renderer.signals([data]).ravel(), renderer.brightest


def caught(receptors="rgb"):
    """Return the quantum catch by quadrature to 1 nm over each type's range, relative to white in daylight."""
    types = optics.receptors_of(receptors)
    low, high = types.limits_nm
    nm = NM[(low <= NM) & (high >= NM)]
    catch = types.catch(nm)
    lamp, daylight = (optics.illuminant(name).at(nm * 1e-9) for name in ("FL11", "D65"))
    return np.trapezoid(catch * lamp, nm) / np.trapezoid(catch * daylight, nm)


@pytest.mark.filterwarnings("ignore:.*bands. receptor type")
@pytest.mark.parametrize(
    ("kind", "bands"), [*((kind, 4) for kind in LAMPS), ("directional", 8), ("spot", 16), ("headlight", 8)]
)
def test_white_is_what_receptors_catch_of_the_lamp(kind, bands):
    """Sampling the lamp at the bands' centres would give up to twice this value, or half of it."""
    found, brightest = seen(kind, bands)
    np.testing.assert_allclose(found, caught(), rtol=0.02)  # the lamp has narrow lines between entries of two tables
    np.testing.assert_allclose(found, seen(kind, 64)[0], rtol=1e-3)
    if kind == "directional":
        assert brightest == pytest.approx(found.max(), rel=1e-3)


def test_daylight_by_name_is_daylight():
    np.testing.assert_allclose(seen("directional", 4, "D65")[0], seen("directional", 4, None)[0], rtol=1e-4)


def test_too_few_bands_are_told():
    with pytest.warns(sim.MirrorWarning, match=r"'lamp' in 4 bands: receptor type \d catches .* should catch"):
        seen("directional", 4, receptors="honeybee")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        seen("directional", 16, receptors="honeybee")


def test_pictures_and_worlds_keep_the_lamp_itself():
    """Renderings for people have their own wavelengths, and so keep the lamp's spectrum."""
    eye = optics.Eye(resolution=(1, 1), fov_deg=1, bands=16)
    model = model_of("directional")
    renderer = sim.ModelRenderer(model, eye, [sim.Mount("eye")], 1, sim.Fidelity(1, bands=16), spectra={"lamp": "FL11"})
    assert renderer.spectra == {"lamp": optics.illuminant("FL11")}
