"""Noise matrices of brakes with several shoes: how loud they are, and what a procedure changes."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import drums
from drumsqueal.errors import RequestError
from drumsqueal.questions.sweep.matrix_cells import LoudestSqueal, _note, _rms, find_matrix
from drumsqueal.questions.sweep.matrix_plan import MatrixAxes, MatrixPlan, Procedure, read_matrix
from drumsqueal.questions.sweep.points import CELL_VERDICTS, CellVerdict, blank, names_of, to_dataset
from drumsqueal.scene import Profile

NAMES = ("leading.X", "leading.Y", "leading.Tz", "trailing.X", "trailing.Y", "trailing.Tz", "drum.E1")
MASS = np.array([2.0, 2.0, 0.01, 1.0, 1.0, 0.005, 1.0])
PLACES = {"leading": 0.0, "trailing": np.pi}  # rad
FRICTION = {"law": "constant", "coefficient": 0.3}
PUSH = {"at": [0.08, 0.0, 0.0], "direction": [1.0, 0.0, 0.0], "size": 500.0}


@pytest.mark.parametrize(
    ("velocity", "wanted"),
    [([1, 0, 0, 1, 0, 0, 0], 1.0), ([0, 0, 0, 0, 1, 0, 0], 1 / np.sqrt(3)), ([1, 0, 0, 0, 0, 0, 0], np.sqrt(2 / 3))],
    ids=["both at 1 m/s", "the lighter alone", "the heavier alone"],
)
def test_the_level_of_several_shoes_is_over_the_mass_of_all(velocity, wanted):
    model: Any = SimpleNamespace(names=NAMES, mass=MASS)
    energy = MASS @ np.square(velocity) / 2
    assert _rms(model, energy) == pytest.approx(wanted, rel=1e-12)


def test_the_mode_of_a_large_disturbance_has_the_name_of_its_shoe(tmp_path, nominal):
    both = drums.several(nominal, PLACES, arc_angle=1.4)
    axes: MatrixAxes = {
        "scene": {"one": {"number": 0}, "both": {"number": 1}},
        "procedure": {"constant": {"number": 0}},
    }
    plan = MatrixPlan("", (nominal, both), axes, (Procedure("constant"),))
    columns = blank(plan, 2)
    columns["squeal"][:] = CELL_VERDICTS.index(CellVerdict.SQUEALS)
    for k, mode in enumerate(("Y", "trailing.Y (2)")):
        start: Any = SimpleNamespace(name=mode, disturbance=SimpleNamespace(mode=mode))
        _note(columns, k, [LoudestSqueal(start, 1.0, 1e3)], names_of(plan), settled=True)
    found = find_matrix(to_dataset(plan, columns, "complete"), plan)
    assert [cell.after for cell in found.cells] == ["large, along Y", "large, along trailing.Y"]


def test_a_procedure_of_the_load_changes_that_of_every_shoe_and_every_force(nominal):
    own = {**nominal.contact.model_dump(), "normal_load": 700.0}
    pushed = {"shoe.0.force": [PUSH], "shoe.1.contact": own, "steady.state": "self-consistent"}
    scene = drums.several(nominal, PLACES, arc_angle=1.4).with_values(pushed)
    over = Procedure("ramp", (0.0, 1.0), (), (1.0, 0.5)).over(scene)
    load = nominal.contact.normal_load
    assert over.schedules() == {
        "drum.speed": scene.drum.speed,
        "contact.normal_load": Profile((0.0, 1.0), (load, load / 2)),
        "shoe.0.force.0.size": Profile((0.0, 1.0), (500.0, 250.0)),
        "shoe.1.contact.normal_load": Profile((0.0, 1.0), (700.0, 350.0)),
    }


def test_a_table_takes_each_of_the_shoes_that_do_not_feel_each_other(tmp_path, nominal):
    own = {"shoe.1.contact": {"stiffness": 2e10, "normal_load": 700.0}, "shoe.1.friction": FRICTION}
    scene = drums.several(nominal, PLACES, arc_angle=1.4).with_values(own)
    (tmp_path / "both.toml").write_text(scene.to_toml())
    table = tmp_path / "noise.toml"
    table.write_text('scenes = ["both.toml"]\n[vary]\n"contact.stiffness" = [1e10]\n')
    with pytest.raises(RequestError, match=r'write shoe = \["leading", "trailing"\] in \[vary\]'):
        read_matrix(table)
    table.write_text(f'{table.read_text()}shoe = ["leading", "trailing"]\n"shoe.thickness" = [0.01]\n')
    plan = read_matrix(table)
    numbers = {"contact.stiffness": 1e10, "shoe.thickness": 0.01}
    assert [plan.scene_at(k)[0] for k in range(plan.points)] == [one.with_values(numbers) for one in scene.alone]
    assert {"Y", "trailing.Y"} <= set(names_of(plan))


def test_a_table_takes_scenes_whose_shoes_have_friction_of_their_own(tmp_path, nominal):
    cup = {**drums.CUP, "up_to": 700.0}
    scene = drums.several(nominal, PLACES, cup, arc_angle=1.4, friction=None).with_values({"shoe.1.friction": FRICTION})
    (tmp_path / "both.toml").write_text(scene.to_toml())
    (tmp_path / "noise.toml").write_text('scenes = ["both.toml"]')
    assert read_matrix(tmp_path / "noise.toml").scenes == (scene,)
