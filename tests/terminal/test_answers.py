"""What quick commands answer about shipped scenes and a truck's brake, held to what they last did (`answers.py`)."""

import pytest

RIGID = (
    "constant_friction", "damped", "leading_shoe", "out_of_plane", "ramp", "rocking", "self_consistent", "stop",
    "trailing_shoe", "uncertain",
)  # fmt: skip
SCENES = {name: (name,) for name in RIGID} | {
    "bending": ("nominal", "--set", 'shoe.elastic={young="210 GPa", poisson=0.3, up_to="8 kHz"}'),
    "warm": ("damped", "--set", 'temperature={heat_capacity="300 J/K", cooling="2 W/K", fade="0.001 1/K"}'),
    "truck": ("tests/data/truck.toml", "--set", "shoe=leading"),
}
SWEEPS = {
    "two_numbers": ("damped", "--vary", "drum.speed=5..50 x 3", "--vary", "friction.static=0.4..0.6 x 2"),
    "at_random": ("uncertain", "--random", "4", "--seed", "1"),
    "a_pushed_shoe": ("leading_shoe", "--vary", "shoe.force.0.size=1..3 kN x 2"),
}


@pytest.mark.parametrize("name", SCENES)
def test_eigenvalues(drumsqueal, as_kept, tmp_path, name):
    status, printed, errors = drumsqueal("stability", *SCENES[name])
    assert (status, errors) == (0, "")
    assert drumsqueal("stability", *SCENES[name], "--json", str(tmp_path / "stability.json")) == (0, "", "")
    as_kept(f"stability_{name}", printed, tmp_path)


@pytest.mark.parametrize("name", [name for name in SCENES if name != "bending"])
def test_what_follows_from_a_scene(drumsqueal, as_kept, tmp_path, name):
    status, printed, errors = drumsqueal("check", *SCENES[name])
    assert (status, errors) == (0, "")
    assert drumsqueal("check", *SCENES[name], "--json", str(tmp_path / "check.json")) == (0, "", "")
    as_kept(f"check_{name}", printed, tmp_path)


@pytest.mark.parametrize("name", SWEEPS)
def test_sweeps_of_eigenvalues(drumsqueal, as_kept, tmp_path, name):
    status, printed, errors = drumsqueal("sweep", *SWEEPS[name], "-o", str(tmp_path))
    assert (status, errors) == (0, "")
    as_kept(f"sweep_{name}", printed, tmp_path)
