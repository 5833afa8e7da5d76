"""An elastic shoe on an elastic drum, without friction: frequencies of the pair against CalculiX on one mesh of both.

Nothing is shared with it: CalculiX knows no modes of the parts and no quadrature of the contact, which is a layer of
solid elements there.
"""

import json
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

from drums import CUP
from drumsqueal.physics.composition import coordinates_of
from drumsqueal.physics.model import Model, build_model
from drumsqueal.scene import Scene, scene_from_dict
from drumsqueal.solve.linear.steady import linear_model

MESHES = Path(__file__).with_name("meshes")
CALCULIX = {name: np.array(found) for name, found in json.loads((MESHES / "assembly.json").read_text()).items()}
SOFT, STIFF = 3e9, 3.5e10  # N/m³: a soft lining, and that of the paper
BELOW = 4e3  # Hz: half of the least frequency up to which modes of the parts are kept here
STEEL = {"young": 210e9, "poisson": 0.3}
FREE = 2  # motions that the contact does not hold: along the axis and around the drum


# A cut-off of the modes of both parts (Hz), and how far frequencies of the pair then are too high, at most.
CUT_OFFS = {SOFT: {8e3: 0.002, 16e3: 0.001}, STIFF: {8e3: 0.018, 16e3: 0.0035}}
# The drum's own modes are refined until they move by less than that.
REFINED = 1e-3


@pytest.fixture(scope="module")
def sector(nominal) -> Scene:
    """The paper's shoe without its springs, in a cup of cast iron."""
    return nominal.with_values({"support.upper_stiffness": 0.0, "support.lower_stiffness": 0.0})


def as_mesh(sector: Scene) -> Scene:
    """The same shoe as a mesh of 160 elements, whose own frequencies are up to 0.21 % too high."""
    tables = sector._tables()
    file = {"file": str(MESHES / "sector_hex27.msh"), "unit": "mm", "lining": "LINING"}
    return scene_from_dict({**tables, "shoe": {"density": tables["shoe"]["density"], "mesh": file}})


def model_of(scene: Scene, stiffness: float, up_to: float) -> Model:
    """With all coordinates, and modes of both parts up to a frequency."""
    elastic = {"shoe.elastic": {**STEEL, "up_to": up_to}, "drum.elastic": {**CUP, "up_to": up_to}}
    scene = scene.with_values({**elastic, "contact.stiffness": stiffness})
    return build_model(scene, coordinates=coordinates_of(scene))


def frequencies(scene: Scene, stiffness: float, up_to: float) -> np.ndarray:
    """Of the frictionless pair in full contact (Hz), without its two free motions."""
    model = model_of(scene, stiffness, up_to)
    squares = scipy.linalg.eigh(np.asarray(model.stiffness), np.diag(np.asarray(model.mass)), eigvals_only=True)
    assert np.all(np.abs(squares[:FREE]) < 1e-12 * squares[-1])
    return np.sqrt(squares[FREE:]) / (2 * np.pi)


def witness(stiffness: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies of CalculiX below 4 kHz (Hz), and how far those of a coarser mesh are above them."""
    name = "soft" if stiffness == SOFT else "stiff"
    fine, coarse = (CALCULIX[f"{name}_{key}"][FREE:] for key in ("fine_Hz", "coarse_Hz"))
    count = int(np.sum(fine < BELOW))
    return fine[:count], coarse[:count] / fine[:count] - 1


def within(found: np.ndarray, stiffness: float, too_high: float) -> bool:
    """Whether they are those of CalculiX: at most that much above, and no further below than its mesh is too stiff."""
    fine, moved = witness(stiffness)
    difference = found[: fine.size] / fine - 1
    # The cup is clamped at an edge, where errors fall slowly: by 3 for elements of half the size.
    return bool(np.all(difference < too_high) and np.all(difference > -moved / 2 - REFINED))


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("stiffness", "up_to"), [(stiffness, up_to) for stiffness, each in CUT_OFFS.items() for up_to in each]
)
def test_a_shoe_bonded_to_a_drum_has_the_frequencies_that_calculix_finds(sector, stiffness, up_to):
    too_high = CUT_OFFS[stiffness][up_to]
    assert within(frequencies(sector, stiffness, up_to), stiffness, too_high)
    assert not within(frequencies(sector, stiffness / 2, up_to), stiffness, too_high)


@pytest.mark.thorough
@pytest.mark.parametrize("stiffness", [SOFT, STIFF])
@pytest.mark.parametrize("factor", [0.97, 1.03])
def test_three_percent_of_the_contact_stiffness_would_show(sector, stiffness, factor):
    up_to = max(CUT_OFFS[stiffness])
    assert not within(frequencies(sector, factor * stiffness, up_to), stiffness, CUT_OFFS[stiffness][up_to])


@pytest.mark.thorough
@pytest.mark.parametrize("stiffness", [SOFT, STIFF])
def test_so_has_a_shoe_that_is_given_as_a_mesh(sector, stiffness):
    found = frequencies(as_mesh(sector), stiffness, 16e3)
    assert within(found, stiffness, CUT_OFFS[stiffness][16e3])


@pytest.mark.thorough
def test_what_modes_of_the_parts_leave_out_makes_the_pair_too_stiff(sector):
    few, more = (frequencies(sector, STIFF, up_to) for up_to in (8e3, 16e3))
    assert np.all(more[: few.size] < few * (1 + REFINED))


@pytest.mark.thorough
def test_the_pressure_on_the_lining_has_the_stiffness_of_which_these_are_the_frequencies(sector):
    model = model_of(sector.with_values({"friction": None}), STIFF, 8e3)
    _, linear = linear_model(model)
    np.testing.assert_allclose(linear.stiffness, model.stiffness, atol=1e-9 * np.max(np.abs(model.stiffness)))


@pytest.mark.thorough
def test_the_witness_does_not_depend_on_the_layer_that_stands_for_the_contact():
    """Ten times as thick it moves no frequency by more than 3e-4."""
    thin, thick = (CALCULIX[key][FREE:16] for key in ("stiff_coarse_Hz", "stiff_coarse_thick_Hz"))
    np.testing.assert_allclose(thick, thin, rtol=3e-4)
