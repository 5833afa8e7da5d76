"""How large a disturbance must be to start squeal: against unstable cycles that are known, and how it is reported."""

import csv
import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from jax import Array
from scipy.integrate import solve_ivp

from drumsqueal.dynamics import ensemble
from drumsqueal.dynamics.attractor import Response, VelocityPerturbation
from drumsqueal.dynamics.cycles.search import cycle_from
from drumsqueal.dynamics.ensemble import (
    Family,
    IntegratorOptions,
    PerturbationDirection,
    Start,
    find_attractors,
    surface_speed,
)
from drumsqueal.dynamics.saturated import Saturated
from drumsqueal.errors import COMPLETE
from drumsqueal.findings.kinds import Kind
from drumsqueal.physics.model import build_model
from drumsqueal.physics.small_bodies import block_on_belt
from drumsqueal.questions.onset import found as smallest_module
from drumsqueal.questions.onset import study as study_module
from drumsqueal.questions.onset.answer import draw_onset
from drumsqueal.questions.onset.found import PRECISION, Row, smallest_disturbances, verdict, warnings
from drumsqueal.questions.onset.study import predict, study_onset
from drumsqueal.scene import load_scene
from drumsqueal.scene.variation import Variation
from drumsqueal.solve.linear.branches import point_at
from drumsqueal.solve.shooting import ShootingStart as Beginning

DAMPED = Path(__file__).parents[2] / "scenarios" / "damped.toml"
DAMPING, CUBIC, QUINTIC = 0.04, -0.4, 0.5


class Polynomial(eqx.Module):
    """μ = 1 + a (s − 1)³ + b (s − 1)⁵: on a belt of 1 m/s, x″ + c x′ + x + a x′³ + b x′⁵ = 1.

    Averaged, c + 3/4 a A² + 5/8 b A⁴ = 0 for a cycle of amplitude A: 0.4, which is unstable, and 0.894.
    """

    cubic: Array = eqx.field(converter=jnp.asarray, default=CUBIC)
    quintic: Array = eqx.field(converter=jnp.asarray, default=QUINTIC)

    def coefficient(self, slip_speed: Array) -> Array:
        x = slip_speed - 1.0
        return 1.0 + self.cubic * x**3 + self.quintic * x**5


def block(damping: float, mass: float = 1.0):
    return block_on_belt(Polynomial(), damping=damping, belt_speed=1.0, mass=mass, stiffness=mass)


FAMILY = Family(block, ("X",), ("X",))
HOW = IntegratorOptions(10.0, 1e-6, 120.0)  # twenty periods a round


def unstable_cycle() -> float:
    """The velocity at which it passes the place of steady sliding: the motion backwards in time ends on it. SciPy."""

    def backwards(_, y):
        return [-y[1], y[0] + DAMPING * y[1] + CUBIC * y[1] ** 3 + QUINTIC * y[1] ** 5]

    def passes(_, y):
        return y[0]

    found = solve_ivp(backwards, (0, 600), [0.1, 0.0], rtol=1e-10, atol=1e-12, events=passes)
    speeds = np.abs(found.y_events[0][:, 1])
    assert speeds[-2] == pytest.approx(speeds[-1], rel=1e-6)
    return float(speeds[-1])


@pytest.mark.thorough
def test_the_smallest_disturbance_of_the_block_leads_onto_its_unstable_cycle():
    row = Row.at(point_at(block, DAMPING), asked=True)
    seen = []
    *coarse, last = smallest_disturbances(FAMILY, [row], HOW, lambda *told: seen.append(told))
    (found,) = last
    (smallest,) = found.smallest_disturbances
    assert smallest == found.smallest_disturbance
    (motion,) = found.motions
    assert motion.smallest_disturbance == smallest
    assert len(motion.starts) == len(set(motion.starts)) > 5
    wanted = unstable_cycle()
    assert wanted == pytest.approx(0.4, rel=0.01)  # averaged, to second order in friction
    # Where the two that enclose it are 2 % apart, the middle is right to 1 %.
    assert smallest.speed_uncertainty_m_per_s <= PRECISION / 2 * smallest.speed_m_per_s
    assert abs(smallest.speed_m_per_s - wanted) <= smallest.speed_uncertainty_m_per_s
    assert smallest.energy_J == pytest.approx(smallest.speed_m_per_s**2 / 2, rel=1e-12)  # 1 kg
    # The drum's speed is 1 m/s, and so is the velocity of slip reversal.
    assert smallest.boundary_ratio == pytest.approx(smallest.speed_m_per_s, rel=1e-2)
    assert smallest.velocity == pytest.approx({"X": math.copysign(smallest.speed_m_per_s, smallest.velocity["X"])})
    assert smallest.mode == "X"
    # Averaged 0.894 m; sampled ten times a radian.
    assert smallest.leads_to.amplitude == pytest.approx({"X": math.sqrt(0.8)}, rel=0.01)
    # What is known before is less certain, and right, too.
    for (found,) in coarse:
        (before,) = found.smallest_disturbances
        assert abs(before.speed_m_per_s - wanted) <= before.speed_uncertainty_m_per_s
        assert before.speed_uncertainty_m_per_s > smallest.speed_uncertainty_m_per_s
    assert all(what == "smallest disturbance" and done <= total for what, done, total in seen)


@pytest.mark.thorough
def test_a_disturbance_that_is_enough_below_all_that_were_tried_is_sought_below(monkeypatch):
    monkeypatch.setattr(PerturbationDirection, "smallest", 0.8)  # of the contact boundary: twice the unstable cycle
    *_, (last,) = smallest_disturbances(FAMILY, [Row.at(point_at(block, DAMPING), asked=True)], HOW, lambda *_: None)
    (smallest,) = last.smallest_disturbances
    assert (
        abs(smallest.speed_m_per_s - unstable_cycle())
        <= smallest.speed_uncertainty_m_per_s
        <= PRECISION / 2 * smallest.speed_m_per_s
    )


@pytest.mark.thorough
def test_where_no_disturbance_leads_to_squeal_there_is_none():
    # Beyond the fold, at c = 0.072, all motion dies away.
    row = Row.at(point_at(block, 0.09), asked=True)
    assert all(
        not found.smallest_disturbances for (found,) in smallest_disturbances(FAMILY, [row], HOW, lambda *_: None)
    )


def test_the_fastest_point_of_the_lining():
    model = build_model(load_scene(DAMPED))
    shoe = model.shoe
    assert surface_speed(model, np.array([3.0, 4.0, 0.0])) == pytest.approx(5.0)
    # Turning about its centre of gravity, the ends of the lining are farthest from it.
    radius, half, centroid = (float(x) for x in (shoe.outer_radius, shoe.half_angle, shoe.centroid))
    arm = math.hypot(radius * math.cos(half) - centroid, radius * math.sin(half))
    assert surface_speed(model, np.array([0.0, 0.0, 2.0])) == pytest.approx(2 * arm)
    assert surface_speed(block(0.1), np.array([-0.3])) == pytest.approx(0.3)


def test_along_the_axis_the_boundaries_of_the_lining_move_too():
    model = build_model(load_scene(DAMPED.with_name("out_of_plane.toml")))
    shoe = model.shoe
    turning = np.zeros(6)
    turning[model.names.index("Tx")] = 2.0  # about x: the arm is hypot(y, z)
    arm = math.hypot(
        float(shoe.outer_radius) * math.sin(min(float(shoe.half_angle), math.pi / 2)), float(shoe.width) / 2
    )
    assert surface_speed(model, turning) == pytest.approx(2 * arm)


@pytest.mark.slow
def test_the_smallest_disturbance_of_the_brake_is_that_of_its_unstable_cycle():
    # Found by Newton's method, from a state and a period near it; the drum at 45 rad/s.
    scene = load_scene(DAMPED, ["drum.speed=45"])
    predicted = predict(scene, Variation("drum.speed", "rad/s", (45.0, 60.0)))
    family, point = predicted.family, predicted.linear.points[0]
    model, steady = family.model_at(45.0), family.shown(point.steady)
    near = np.array([-5.306e-6, 6.503e-6, 4.826e-6, -0.09458, -4.373, -1.166])
    cycle = cycle_from(model, Beginning(near + np.append(steady, np.zeros(3)), 1 / 940, ""), steady)
    assert not cycle.stable
    vibration, velocity = cycle.samples.displacement - steady, cycle.samples.velocity
    energy = velocity**2 @ np.asarray(model.mass) / 2
    at = int(np.argmax(energy))
    # On either side of it motion dies away, and squeals.
    starts = [Start(f"{size}", size * vibration[at], size * velocity[at]) for size in (0.98, 1.02)]
    ends = {each.start: each for each in find_attractors(family, [(point, start) for start in starts], predicted.how)}
    assert (ends["0.98"].leads_to, ends["1.02"].leads_to) == (Kind.DECAYS, Kind.SQUEALS)
    row = Row.at(point, ends["1.02"], asked=True)
    *_, (last,) = smallest_disturbances(family, [row], predicted.how, lambda *_: None)
    (smallest,) = last.smallest_disturbances
    assert smallest.mode == "Y"
    # A disturbance along the mode has a part that decays first: it takes a little more. Found: 11.5 ± 0.1 J over
    # 11.36 J.
    assert energy[at] - smallest.energy_uncertainty_J < smallest.energy_J < 1.05 * energy[at]
    for size, kind in ((1 - PRECISION, Kind.DECAYS), (1 + PRECISION, Kind.SQUEALS)):
        start = Start("disturbance", 0 * vibration[at], size * np.array(list(smallest.velocity.values())))
        (found,) = find_attractors(family, [(point, start)], predicted.how)
        assert found.leads_to == kind


# --- how it is reported ----------------------------------------------------------------------------------------------

QUICK = ["--set", 'simulate.coordinates=["Y"]', "--set", "start.displacement={Y = 1e-7}"]


def table(folder: Path) -> list[dict[str, str]]:
    return list(csv.DictReader((folder / "onset.csv").read_text(encoding="utf-8").splitlines()))


def made_up(threshold):
    """Squeal below 25 rad/s; above the critical value only from disturbances of Y beyond a velocity, or from none."""

    def find(family, tasks, how, *, rounds, known=None, progress=None):
        for point, start in tasks:
            enough = start.name.startswith("disturbance Y") and abs(start.velocity[0]) > threshold(point.value)
            goes_on = "from" in start.name or ": " in start.name  # with a motion that was reached before
            lasts = point.value < 25 and (point.unstable or goes_on or enough)
            one = np.array([1e-5])
            motion = Saturated(one, one, (0.0, 1.5), 1000.0, "Y", 1.0, 0.0, 1.0, one, one, COMPLETE)
            leads = Kind.SQUEALS if lasts else Kind.DECAYS
            yield Response.of(point.value, start.name, leads, motion, 0.1, ("Y",), disturbance=start.disturbance)

    return find


@pytest.mark.parametrize("elsewhere", [Kind.DECAYS, Kind.RESTS])
def test_what_was_tried_before_counts_by_its_size(monkeypatch, elsewhere):
    # Sizes are √J: along a mode of 2 m/s for 1 J, 0.15 leads to squeal and less does not. 0.1 and 0.2 were tried.
    def disturbance(size):
        return VelocityPerturbation(
            mode="Y",
            forwards=True,
            velocity={"Y": 2 * size},
            speed_m_per_s=2 * size,
            energy_J=size**2,
            boundary_ratio=size,
        )

    one = np.array([1e-5])
    ended = Saturated(one, one, (0.0, 1.5), 1000.0, "Y", 1.0, 0.0, 1.0, one, one, COMPLETE)
    tried = []

    def leads(size, name):
        leads_to = Kind.SQUEALS if size > 0.15 else elsewhere
        return Response.of(1.0, name, leads_to, ended, 0.1, ("Y",), disturbance=disturbance(size))

    def find(family, tasks, how, *, rounds, known=None, progress=None):
        for _, start in tasks:
            tried.append(math.sqrt(start.disturbance.energy_J))
            yield leads(tried[-1], start.name)

    along = SimpleNamespace(
        mode=SimpleNamespace(label="Y"), forwards=True, sizes=[0.1, 0.2], least=0.1, disturbance=disturbance,
        start=lambda size: Start(f"disturbance Y {size:.6g}", 0 * one, 2 * size * one, disturbance=disturbance(size)),
    )  # fmt: skip
    monkeypatch.setattr(smallest_module, "directions", lambda *_: [along])
    monkeypatch.setattr(ensemble, "find_attractors", find)
    point: Any = SimpleNamespace(value=1.0, reason="", unstable=False, growth_rate=-1.0)
    row = Row.at(point, leads(0.1, "disturbance Y 0.1"), leads(0.2, "disturbance Y 0.2"), asked=True)
    *_, ((found,)) = smallest_disturbances(cast("Any", None), [row], HOW, lambda *_: None)
    (smallest,) = found.smallest_disturbances
    assert all(0.1 < size < 0.2 for size in tried)
    assert abs(smallest.speed_m_per_s - 0.3) <= smallest.speed_uncertainty_m_per_s <= PRECISION / 2 * 0.31
    assert smallest.energy_J == pytest.approx(smallest.speed_m_per_s**2 / 4)
    # Half of what lies between, of the energy, too: E = (v/2)².
    assert smallest.energy_uncertainty_J == pytest.approx(
        smallest.speed_m_per_s * smallest.speed_uncertainty_m_per_s / 2
    )


@pytest.mark.thorough
def test_the_smallest_disturbance_is_printed_written_and_drawn(drumsqueal, tmp_path, monkeypatch):
    drawn = []
    for module in (study_module, ensemble):
        monkeypatch.setattr(module, "find_attractors", made_up(lambda value: value / 20))
    monkeypatch.setattr("drumsqueal.terminal.style.save_figure", lambda figure, path: drawn.append(figure))
    arguments = ["onset", str(DAMPED), *QUICK, "--along", "drum.speed=1..40x14", "-o", str(tmp_path)]
    status, printed, error = drumsqueal(*arguments, "--smallest-disturbance")
    assert (status, error) == (0, "")
    summary = json.loads((tmp_path / "onset.json").read_text())
    kinds = {each["value"]: each["kind"] for each in summary["values"] if each["asked"]}
    disturbances = {
        each["value"]: each["smallest_disturbance"] for each in summary["values"] if each["smallest_disturbance"]
    }
    assert list(disturbances) == [value for value, kind in kinds.items() if kind == "bistable"]
    mass = float(build_model(load_scene(DAMPED)).mass[1])
    for value, smallest in disturbances.items():
        assert abs(smallest["speed_m_per_s"] - value / 20) <= smallest["speed_uncertainty_m_per_s"]
        assert smallest["speed_uncertainty_m_per_s"] < PRECISION * smallest["speed_m_per_s"]
        assert smallest["energy_J"] == pytest.approx(mass * smallest["speed_m_per_s"] ** 2 / 2)
        assert (smallest["mode"], smallest["leads_to"]["amplitude"]) == ("Y", {"Y": 1e-5})
    rows = {float(row["drum.speed_rad_per_s"]): row for row in table(tmp_path)}
    told = {value: row["smallest_disturbance_speed_m_per_s"] for value, row in rows.items()}
    assert told == {value: str(disturbances[value]["speed_m_per_s"]) if value in disturbances else "" for value in rows}
    words = " ".join(printed.split())
    assert "Smallest disturbance that starts squeal" in words
    assert summary["verdict"] in words
    first, last = min(disturbances), max(disturbances)
    assert f"J) at {first:g} rad/s to " in summary["verdict"]
    assert f"J) at {last:g} rad/s at the values tried." in summary["verdict"]
    axes = drawn[0].axes[3]
    assert axes.get_ylabel() == "Smallest disturb-\nance (m/s)"
    points = [line.get_xydata()[0].tolist() for line in axes.lines if line.get_marker() == "s"]
    assert points == [[value, smallest["speed_m_per_s"]] for value, smallest in disturbances.items()]
    # Without the option nothing is sought, or drawn.
    assert drumsqueal(*arguments, "--overwrite")[0] == 0
    again = json.loads((tmp_path / "onset.json").read_text())
    assert not any(each["smallest_disturbance"] for each in again["values"])
    assert (summary["smallest_disturbance_sought"], again["smallest_disturbance_sought"]) == (True, False)
    assert len(drawn[1].axes) == 3
    assert not any("smallest_disturbance" in column for column in table(tmp_path)[0])


def test_squeal_that_no_disturbance_along_a_mode_starts_is_reported(monkeypatch):
    scene = load_scene(DAMPED).with_values({"simulate.coordinates": ["Y"], "start.displacement": {"Y": 1e-7}})
    for module in (study_module, ensemble):
        monkeypatch.setattr(module, "find_attractors", made_up(lambda value: math.inf))
    study = study_onset(scene, "drum.speed=1..40x14", smallest_disturbance=True)
    assert any(row.kind == "bistable" for row in study.values)
    assert not any(row.smallest_disturbance for row in study.values)
    (told,) = (line for line in warnings(study) if "No disturbance" in line)
    assert told.startswith(
        "No disturbance along a mode that was tried starts the squeal that a neighbouring value's motion leads to: "
    )
    assert "smallest disturbance" not in verdict(study)
    assert len(draw_onset(study).axes) == 3
    assert not any(
        "No disturbance" in line for line in warnings(study.model_copy(update={"smallest_disturbance_sought": False}))
    )
