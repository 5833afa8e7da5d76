"""In which shapes a body of a brake bends: its own modes, and how else it yields in the modes of the whole brake.

The lining's stiffness dents shoe and drum where they touch, and so do springs. A body's own modes build a dent slowly:
none of them has forces on its surface. So what is kept besides comes from the modes of the frictionless brake with its
lining in full contact, up to the same frequency: each mode's part in the body, as far as its own modes do not hold it.
"""

import functools
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from typing import Any, NamedTuple, TypeVar

import jax.numpy as jnp
import numpy as np
import scipy.linalg
from jax import Array
from numpy.typing import NDArray

from drumsqueal.coordinates import shape_names
from drumsqueal.interpreter import Interpreted, one_thread
from drumsqueal.physics.bodies.elastic_shoe import ElasticShoe
from drumsqueal.physics.bodies.elements import Indices, Reals
from drumsqueal.physics.bodies.mode_shapes import kept
from drumsqueal.physics.effects.pressure import normal_law, tangent_under
from drumsqueal.physics.effects.springs import SupportSprings
from drumsqueal.physics.shoe_building import Composition, along_points, build_shoe, spring_matrix
from drumsqueal.physics.trial_shapes import frequencies_of, numbers_of_shoe, on_drum, trial_drum, trial_shoe
from drumsqueal.precision import real
from drumsqueal.scene import COORDINATES, Profile, Scene

T = TypeVar("T")

# Of motions of the brake, the root of the fraction of their energy: directions in which they have no more are left out.
# With half of it, growth rates of elastic_drum up to 8 kHz change by 0.1 1/s.
NEGLIGIBLE = 0.02
# Steady sliding decides which part of the lining touches, and growth rates with it: it is to be five times as exact as
# modes are, for coefficients of friction of which the fourth power is nothing.
STEADY, DRAGS = 5.0, 4
# Times the frequency up to which shapes are kept: those that would ring above it get as much more mass, or they would
# hold up the integration of motion that they follow statically. Their stiffness, which is what they are for, stays.
HEAVIER = 4.0
# Times the frequency: what further shapes change. A plate has as many times as many.
MORE = 1.6
# With which "auto" is found: a coefficient of friction as high as linings have, and a damping ratio of brakes, without
# which weak growth next to the end of the range asks for ever more. Half and twice of it find the same for simplex.
COUPLING, DAMPED = 0.5, 0.01
# What shapes depend on, of the brake's numbers, and what of a shoe's own they do not.
YIELDING = ("shoe.", "drum.elastic.", "drum.mesh.", "support.")


class BodyPart(NamedTuple):
    """A body's places among the coordinates of the brake (m,), its own frequencies (m,) in rad/s, its trial shapes."""

    places: Indices
    own: Reals
    trial: Any


class ShoeSide(NamedTuple):
    """One shoe over its trial shapes, without the drum.

    Mass (n,), stiffness (n, n) of springs, `loads` (k, n), forces of 1 N, and u_r and u_θ of the lining (2, n, points)
    at angles (rad) and z (m), with the area (m²) that belongs to each point.
    """

    mass: Any
    stiffness: Any
    loads: Any
    lining: Any
    angle: Any
    z: Any
    area: Any


class Side(NamedTuple):
    """One shoe with the drum under it, over their trial shapes: what acts but for what holds the bodies' own modes.

    Mass (n,), stiffness (n, n) of springs and of the lining in full contact; `linings`, of each one its places among
    the coordinates (m,) with u_r and u_θ (2, m, points) times the root of the stiffness there; and `loads` (k, n),
    forces of 1 N and an even pressure of 1 Pa, that move it steadily.
    """

    mass: Any
    stiffness: Any
    linings: tuple[tuple[Any, Reals], ...]
    loads: Any

    def drag(self, moved: Reals) -> Reals:
        """The force (n, k) along the arc that is the pressure of linings in full contact, by motions (n, k)."""
        found = np.zeros_like(moved)
        for places, (radial, along) in self.linings:
            found[places] += along @ (radial.T @ moved[places])
        return found


@Interpreted
def _shoe_side(composition: Composition, value: Mapping[str, Array]) -> ShoeSide:
    """Find these of a composition, whose coordinates are all of its own."""
    shoe = build_shoe(composition, value)
    springs, pushes = along_points(composition, value, shoe)
    stiffness = jnp.zeros((len(shoe.names), len(shoe.names)))
    if composition.springs:
        stiffness = stiffness + spring_matrix(composition, value, springs, "stiffness")
    if composition.support:
        support = SupportSprings(value["support.upper_stiffness"], value["support.lower_stiffness"], shoe)
        stiffness = stiffness + support.stiffness()
    assert isinstance(shoe, ElasticShoe)  # as one of several shoes is
    angle, z, area, _ = shoe.cells.nodes(shoe.rigid)
    return ShoeSide(shoe.mass, stiffness, pushes, jnp.stack(shoe.sampled[:2]), angle, z, area)


def modes_of(whole: Side, highest: float) -> tuple[Reals, Reals]:
    """Eigenvalues ω² (k,) and modes (n, k) of unit modal mass of a brake, up to a frequency (rad/s)."""
    scale = 1 / np.sqrt(whole.mass)
    limits = -np.inf, highest**2
    squares, shapes = scipy.linalg.eigh(scale[:, None] * whole.stiffness * scale, subset_by_value=limits)
    return squares, scale[:, None] * shapes


def motions(whole: Side, modes: tuple[Reals, Reals], highest: float) -> Reals:
    """What a brake does, of unit energy in its stiffness each (n, k): its modes up to a frequency, and steady sliding.

    Of steady sliding what answers to the loads without friction, to the drag of that, and so on: their sums are its
    steady states at any coefficient of friction.
    """
    squares, shapes = modes
    still = 1e-4  # of the highest frequency: what nothing holds, and which strains nothing
    moving = (squares > (still * highest) ** 2) & (squares <= highest**2)
    found = [shapes[:, moving] / np.sqrt(squares[moving])]
    held = scipy.linalg.cho_factor(whole.stiffness + np.diag(whole.mass) * (still * highest) ** 2)
    steady = scipy.linalg.cho_solve(held, whole.loads.T)
    for _ in range(DRAGS * (len(whole.loads) > 0)):
        energies = np.sum(steady * (whole.stiffness @ steady), axis=0)
        steady = steady[:, energies > 0] / np.sqrt(energies[energies > 0])  # none where nothing drags
        found.append(STEADY * steady)
        steady = scipy.linalg.cho_solve(held, whole.drag(steady))
    return np.concatenate(found, axis=1)


def yielding(part: BodyPart, count: int, stiffness: Reals, moved: Reals, groups: NDArray[Any]) -> Iterator[Reals]:
    """Sums (m, k) of a body's trial shapes beyond its first modes, for each of its groups of shapes (m,).

    Orthonormal, and diagonal in the body's own stiffness. `stiffness` (n, n) and motions `moved` (n, j) of unit energy
    are those of the brake.
    """
    for group in np.unique(groups):
        mine = np.flatnonzero((groups == group) & (np.arange(len(groups)) >= count))
        places = part.places[mine]
        # By energy: what a body's part stores, and what it stores in lining and springs.
        root = np.linalg.cholesky(stiffness[np.ix_(places, places)])
        directions, sizes, _ = np.linalg.svd(root.T @ moved[places], full_matrices=False)
        # Those of a pair may be 1e-3 of it apart, by round-off and by a mesh.
        least = (1 - 1e-3) * np.min(sizes[sizes > NEGLIGIBLE], initial=np.inf)
        found = scipy.linalg.solve_triangular(root.T, directions[:, sizes >= least])
        found = np.linalg.qr(found)[0]
        found = found @ np.linalg.eigh(found.T @ (part.own[mine][:, None] ** 2 * found))[1]
        whole = np.zeros((len(groups), found.shape[1]))
        whole[mine] = found
        yield whole


def once(find: Callable[..., T], most: int = 32) -> Callable[..., T]:
    """Find what goes by a brake's shapes once for all scenes of the same bodies, springs and linings.

    So many brakes are kept `most`.
    """
    known: dict[Any, T] = {}

    @functools.wraps(find)
    def of(scene: Scene, *which: int) -> T:
        key = which, *_shaping(scene), *_files(scene)
        if key not in known:
            while len(known) >= most:
                known.pop(next(iter(known)))
            with one_thread():
                known[key] = find(scene, *which)
        return known[key]

    return of


def _shaping(scene: Scene) -> tuple[Any, ...]:
    """All numbers and words by which a brake's shapes go, but for files."""
    items = scene.numbers().items()
    numbers = (
        each
        for each in items
        if each[0].startswith(YIELDING)
        and not any(part in each[0] for part in (".size", ".friction.", ".damping", ".normal_load"))
    )
    up_to = (table and table.up_to for table in (*(shoe.elastic for shoe in scene.shoes), scene.drum.elastic))
    linings = tuple(map(lining_stiffness, scene.alone))
    return tuple(numbers), linings, scene.steady.state, *map(_rounded, up_to)


def _files(scene: Scene) -> tuple[Any, ...]:
    """The tables of the bodies that are read from files, None of others."""
    drum = scene.drum.mesh and scene.drum.mesh.model_copy(update={"up_to": _rounded(scene.drum.mesh.up_to)})
    return *(shoe.solid for shoe in scene.shoes), drum


def _rounded(number: Any) -> Any:
    """A frequency as far as it is the same when it was multiplied and divided."""
    return float(f"{number:.12g}") if isinstance(number, float) else number


class Kept(NamedTuple):
    """The shapes of each shoe and of the drum that are kept of a scene; those of a body are found when asked for."""

    scene: Scene
    further: int

    def shapes(self, body: int) -> Any:
        """Those of a shoe, counted from 0, or of the drum, −1: none of a rigid one, or of a rigid file its inertia."""
        return _kept(self.scene, body)[self.further][0]

    def sums(self, body: int) -> Reals:
        """Which sums of trial shapes (k, m) they are."""
        return _kept(self.scene, body)[self.further][1]

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Those (1/s) of the brake in these shapes that oscillate.

        Without the mass that HEAVIER adds, with a coefficient of friction of COUPLING and a damping ratio of DAMPED.
        """
        *of_shoes, of_drum = (self.sums(body) for body in (*range(len(self.scene.shoes)), -1))
        kept: Any = scipy.linalg.block_diag(
            *(each for own in of_shoes for each in (np.eye(len(COORDINATES)), own.T)), of_drum.T
        )
        side = _whole(self.scene).side
        forces = kept.T @ (side.stiffness @ kept - COUPLING * side.drag(kept))
        values: Any = np.sqrt(-np.linalg.eigvals(forces / (side.mass @ kept**2)[:, None]).astype(complex))
        values = np.where(values.imag < 0, -values, values)[values.imag != 0]  # of each two ±λ
        return values - DAMPED * values.imag


_further: ContextVar[bool] = ContextVar("_further", default=False)


@contextmanager
def further_shapes() -> Iterator[None]:
    """What is asked of shapes here is of scenes with MORE times the frequency, and their trial shapes are not more."""
    token = _further.set(True)
    try:
        yield
    finally:
        _further.reset(token)


def kept_shapes(scene: Scene) -> Kept:
    """Those of a scene with something that bends; those of a shoe with the drum, other shoes left out."""
    if not _further.get():
        return Kept(scene, 0)
    shoes = enumerate(scene.shoes)
    tables: Any = ((scene.key_of(k, "shoe.elastic"), shoe.elastic) for k, shoe in shoes if not shoe.modes)
    up_to = {f"{key}.up_to": table.up_to for key, table in (*tables, scene.elastic_table("drum")) if table is not None}
    return Kept(scene.with_values({key: _rounded(each / MORE) for key, each in up_to.items()}), 1)


@once
def _kept(scene: Scene, body: int) -> list[tuple[Any, Reals]]:
    """Shapes of a body and sums of trial shapes, and those up to MORE times the frequency of the same trial shapes.

    These hold the body's modes up to a fourth beyond that, and how it yields besides: enough to see what changes below.
    """
    if body >= 0 and scene.shoes[body].elastic is None:
        return [(trial_shoe(scene.alone[body]), np.zeros((0, 0)))] * 2
    if body >= 0 and scene.several:
        return _kept(scene.alone[body], 0)
    if body < 0 and scene.elastic_table("drum")[1] is None:
        return [(None, np.zeros((0, 0)))] * 2
    trial: Any = trial_drum(scene) if body < 0 else trial_shoe(scene)
    find = partial(_sums, scene, body)
    # By all that they come from; `once` knows them by less, as formulas stay while a process runs. Of a mesh they are
    # found anew.
    told = repr((body, *_shaping(scene))).encode() + trial.coefficients.tobytes()
    sums = find() if any(_files(scene)) else kept("brake", [told], find)
    return [(trial.combined(each), each) for each in (sums["own"], sums["further"])]


def _sums(scene: Scene, body: int) -> dict[str, Reals]:
    """Which sums of trial shapes are kept of a body that bends, and which up to MORE times the frequency."""
    whole = _whole(scene)
    part = whole.parts[body]
    parity = np.array(part.trial.symmetric) if scene.planar else np.zeros(len(part.own), dtype=bool)

    def up_to(highest: float) -> Reals:
        return _sums_up_to(part, whole.side.stiffness, whole.motions(highest), highest, parity)

    own, further = (up_to(each[body]) for each in whole.up_to)
    return {"own": own, "further": further}


class Whole(NamedTuple):
    """A brake over trial shapes, its bodies, up to which frequencies (rad/s) own and further shapes of each are kept.

    And its motions up to a frequency.
    """

    side: Side
    parts: list[BodyPart]
    up_to: tuple[list[float], list[float]]
    motions: Callable[[float], Reals]


def _over_trial_shapes(scene: Scene) -> Whole:
    side, parts = _assembled(scene)
    tables: Any = *(shoe.elastic for shoe in scene.shoes), scene.elastic_table("drum")[1]
    own = [2 * np.pi * table.up_to if table else 0.0 for table in tables]
    given = [*(shoe.modes is not None for shoe in scene.shoes), False]  # of modal results there is no more
    further = [each if fixed else MORE * each for each, fixed in zip(own, given, strict=True)]
    modes = modes_of(side, max(further))
    return Whole(side, parts, (own, further), functools.cache(partial(motions, side, modes)))


_whole = once(_over_trial_shapes, most=1)  # some 100 MB of a brake whose shoes and drum bend


def _sums_up_to(part: BodyPart, stiffness: Reals, moved: Reals, highest: float, parity: NDArray[np.bool_]) -> Reals:
    """A body's modes up to a frequency (rad/s), and sums of other trial shapes in which it yields besides, (k, m)."""
    count = int(np.sum(part.own <= highest))
    more = yielding(part, count, stiffness, moved, parity)
    sums = np.concatenate([np.eye(len(part.own))[:, :count], *more], axis=1)
    frequencies = np.sqrt(np.einsum("ij,i->j", sums**2, part.own**2))
    sums *= np.minimum(1.0, HEAVIER * highest / frequencies)
    return sums[:, np.argsort(frequencies, kind="stable")].T


def _assembled(scene: Scene) -> tuple[Side, list[BodyPart]]:
    """The frictionless brake over trial shapes, and the parts of its shoes and of the drum."""
    trial = trial_drum(scene)
    of_drum = 2 * np.pi * frequencies_of(scene, "drum", trial)
    places = (getattr(shoe, "position", 0.0) for shoe in scene.shoes)
    sides = [one_side(*each, trial) for each in zip(scene.alone, places, strict=True)]
    ends = np.cumsum([0, *(len(side.mass) - len(of_drum) for side, _ in sides)])
    size = ends[-1] + len(of_drum)
    drum = BodyPart(np.arange(ends[-1], size), of_drum, trial)
    mass, stiffness = np.ones(size), np.zeros((size, size))
    stiffness[drum.places, drum.places] = of_drum**2
    parts, loads, linings = [], [], []
    for first, last, (side, part) in zip(ends[:-1], ends[1:], sides, strict=True):
        places = np.concatenate([np.arange(first, last), drum.places])
        mass[places] = side.mass
        stiffness[np.ix_(places, places)] += side.stiffness
        linings += [(places[mine], lining) for mine, lining in side.linings]
        loads.append(np.zeros((len(side.loads), size)))
        loads[-1][:, places] = side.loads
        parts.append(part._replace(places=first + part.places))
        stiffness[parts[-1].places, parts[-1].places] += part.own**2
    return Side(mass, stiffness, tuple(linings), np.concatenate(loads)), [*parts, drum]


@once
def _trial_side(scene: Scene) -> tuple[ShoeSide, BodyPart]:
    """One shoe over its trial shapes, and where its own are."""
    shoe = trial_shoe(scene)
    own = 2 * np.pi * frequencies_of(scene, "shoe", shoe)
    composition = Composition(
        coordinates=(*COORDINATES, *shape_names(0, len(own))),
        support=scene.support is not None,
        springs=len(scene.shoe.spring),
        pushes=len(scene.shoe.force),
        symmetric_modes=(False,) * len(own),
        mesh=scene.shoe.solid is not None,
    )
    value = scene.numbers() | numbers_of_shoe(scene, shoe) | {"shoe.position": 0.0}
    side = _shoe_side(composition, {key: real(each) for key, each in value.items() if key.startswith(YIELDING)})
    return side, BodyPart(len(COORDINATES) + np.arange(len(own)), own, shoe)


def lining_stiffness(scene: Scene) -> float:
    """dp/du (N/m³) of the lining of one shoe under its largest load and pushes, spread evenly."""
    scheduled = (scene.contact.normal_load, *(force.size for force in scene.shoe.force))
    loads = (max(map(abs, each.value)) if isinstance(each, Profile) else abs(each) for each in scheduled)
    area = scene.shoe.outer_radius * scene.shoe.arc_angle * scene.shoe.width
    return float(tangent_under(normal_law(scene.numbers()), np.asarray(sum(loads) / area)))


def one_side(scene: Scene, position: float, drum: Any) -> tuple[Side, BodyPart]:
    """One shoe over its trial shapes and, at a position (rad) on it, those of the drum; and where its own are."""
    shoe, part = _trial_side(scene)
    lining, mass, own = shoe.lining, shoe.mass, len(shoe.mass)
    if drum is not None:
        moved = on_drum(scene, drum, shoe.angle + position, shoe.z)
        lining, mass = np.concatenate([lining, -moved], axis=1), np.append(mass, np.ones(moved.shape[1]))
    pushes, pressure = np.pad(shoe.loads, ((0, 0), (0, len(mass) - own))), lining[0] @ shoe.area
    loads = np.concatenate([pushes, pressure[None]])[: 0 if scene.steady.state == "uniform-pressure" else None]
    lining = lining * np.sqrt(lining_stiffness(scene) * shoe.area)
    stiffness = lining[0] @ lining[0].T
    stiffness[:own, :own] += shoe.stiffness
    return Side(mass, stiffness, ((np.arange(len(mass)), lining),), loads), part
