"""In which shapes a body of a brake bends: its own modes, and how else it yields in the modes of the whole brake.

The lining's stiffness dents shoe and drum where they touch, and so do springs. A body's own modes build a dent slowly:
none of them has forces on its surface. So what is kept besides comes from the modes of the frictionless brake with its
lining in full contact, up to the same frequency: each mode's part in the body, as far as its own modes do not hold it.
"""

import functools
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
import scipy.linalg
from jax import Array
from numpy.typing import NDArray

from drumsqueal.coordinates import DRUM, shape_names
from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.bodies.elastic_shoe import ElasticShoe
from drumsqueal.physics.effects.springs import SupportSprings
from drumsqueal.physics.shoes import along_points, build_shoe, spring_matrix
from drumsqueal.physics.structure import Composition
from drumsqueal.physics.trial_shapes import frequencies_of, numbers_of_drum, numbers_of_shoe, trial_drum, trial_shoe
from drumsqueal.precision import real
from drumsqueal.scene import COORDINATES, Scene

Reals = NDArray[np.float64]

# Of motions of the brake, the root of the fraction of their energy: directions in which they have no more are left out.
# With half of it, growth rates of elastic_drum up to 8 kHz change by 0.1 1/s.
NEGLIGIBLE = 0.02
# Steady sliding decides which part of the lining touches, and growth rates with it: it is to be five times as exact as
# modes are, for coefficients of friction of which the fourth power is nothing.
STEADY, DRAGS = 5.0, 4
# Times the frequency up to which shapes are kept: those that would ring above it get as much more mass, or they would
# hold up the integration of motion that they follow statically. Their stiffness, which is what they are for, stays.
HEAVIER = 4.0
# With which "auto" is found: a coefficient of friction as high as linings have, and a damping ratio of brakes, without
# which weak growth next to the end of the range asks for ever more. Half and twice of it find the same for simplex.
COUPLING, DAMPED = 0.5, 0.01
# What shapes depend on, of the brake's numbers, and what of a shoe's own they do not.
YIELDING = ("shoe.", "drum.elastic.", "drum.mesh.", "contact.stiffness", "support.")


class BodyPart(NamedTuple):
    """A body's places among the coordinates of the brake (m,), its own frequencies (m,) in rad/s, its trial shapes."""

    places: NDArray[np.int64]
    own: Reals
    trial: Any


class Side(NamedTuple):
    """One shoe with the drum under it, over their trial shapes: what acts but for what holds the bodies' own modes.

    Mass (n,), stiffness (n, n) of springs and of the lining in full contact; `drag` (n, n), the force along the arc of
    that lining's pressure; and `loads` (k, n), forces of 1 N and an even pressure of 1 Pa, that move it steadily.
    """

    mass: Any
    stiffness: Any
    drag: Any
    loads: Any


@Interpreted
def side_of(composition: Composition, value: Mapping[str, Array]) -> Side:
    """Find these of a composition; loads only where its steady state is not that of even pressure."""
    shoe, law = build_shoe(composition, value), value["contact.stiffness"]
    springs, pushes = along_points(composition, value, shoe)
    stiffness = law * shoe.radial_stiffness()
    if composition.springs:
        stiffness = stiffness + spring_matrix(composition, value, springs, "stiffness")
    if composition.support:
        support = SupportSprings(value["support.upper_stiffness"], value["support.lower_stiffness"], shoe)
        stiffness = stiffness + support.stiffness()
    assert isinstance(shoe, ElasticShoe)  # as one of several shoes, or one that bends, is
    drag = law * (shoe.sampled[1] * shoe.weights) @ shoe.sampled[0].T
    loads = jnp.zeros((0, len(shoe.names)))
    if composition.steady_state != "uniform-pressure":
        loads = jnp.concatenate([pushes, (shoe.sampled[0] @ shoe.weights)[None]])
    return Side(shoe.mass, stiffness, drag, loads)


def motions(whole: Side, highest: float) -> Reals:
    """What a brake does, of unit energy in its stiffness each (n, k): its modes up to a frequency, and steady sliding.

    Of steady sliding what answers to the loads without friction, to the drag of that, and so on: their sums are its
    steady states at any coefficient of friction.
    """
    scale = 1 / np.sqrt(whole.mass)
    limits = -np.inf, highest**2
    squares, shapes = scipy.linalg.eigh(scale[:, None] * whole.stiffness * scale, subset_by_value=limits)
    still = 1e-4  # of the highest frequency: what nothing holds, and which strains nothing
    moving = squares > (still * highest) ** 2
    found = [scale[:, None] * shapes[:, moving] / np.sqrt(squares[moving])]
    held = scipy.linalg.cho_factor(whole.stiffness + np.diag(whole.mass) * (still * highest) ** 2)
    steady = scipy.linalg.cho_solve(held, whole.loads.T)
    for _ in range(DRAGS * (len(whole.loads) > 0)):
        energies = np.sum(steady * (whole.stiffness @ steady), axis=0)
        steady = steady[:, energies > 0] / np.sqrt(energies[energies > 0])  # none where nothing drags
        found.append(STEADY * steady)
        steady = scipy.linalg.cho_solve(held, whole.drag @ steady)
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


def once(find: Callable[[Scene], Any]) -> Callable[[Scene], Any]:
    """Find what goes by a brake's shapes once for all scenes of the same bodies, springs and linings."""
    known: dict[Any, Any] = {}

    @functools.wraps(find)
    def of(scene: Scene) -> Any:
        items = scene.numbers().items()
        numbers = (
            each
            for each in items
            if each[0].startswith(YIELDING)
            and not any(part in each[0] for part in (".size", ".friction.", ".damping", ".normal_load"))
        )
        files = *(shoe.solid for shoe in scene.shoes), scene.drum.mesh
        up_to = (table and table.up_to for table in (*(shoe.elastic for shoe in scene.shoes), scene.drum.elastic))
        key = tuple(numbers), scene.steady.state, *up_to, *files
        if key not in known:
            if len(known) >= 32:  # brakes
                known.pop(next(iter(known)))
            known[key] = find(scene)
        return known[key]

    return of


class Kept(NamedTuple):
    """Of each shoe and of the drum the shapes that are kept, and which sums of trial shapes (k, m) they are.

    None of a rigid one, or of a rigid file its inertia. `eigenvalues` (1/s) are those of the brake in these shapes,
    without the mass that HEAVIER adds, with a coefficient of friction of COUPLING and a damping ratio of DAMPED.
    """

    shapes: tuple[Any, ...]
    sums: tuple[Reals, ...]
    eigenvalues: NDArray[np.complex128]


@once
def kept_shapes(scene: Scene) -> Kept:
    """Find them of a scene with something that bends; those of a shoe with the drum, other shoes left out."""
    whole, parts = _assembled(scene)
    tables: Any = *(shoe.elastic for shoe in scene.shoes), scene.elastic_table("drum")[1]
    up_to = [2 * np.pi * table.up_to if table else 0.0 for table in tables]
    found = [_kept_alone(one) for one in scene.alone] if scene.several else []
    for part, highest in list(zip(parts, up_to, strict=True))[len(found) :]:
        parity = np.array(part.trial.symmetric) if highest and scene.planar else np.zeros(len(part.own), dtype=bool)
        sums = _sums(part, whole, highest, parity) if highest else np.zeros((0, 0))
        found.append((part.trial.combined(sums) if highest else part.trial, sums))
    shapes, sums = zip(*found, strict=True)
    return Kept(shapes, sums, _eigenvalues(whole, sums))


def _kept_alone(one: Scene) -> tuple[Any, Reals]:
    """Shapes of one of several shoes, and their sums: none of a rigid one, which may be on a rigid drum."""
    if one.shoe.elastic is None:
        return trial_shoe(one), np.zeros((0, 0))
    kept = kept_shapes(one)
    return kept.shapes[0], kept.sums[0]


def _sums(part: BodyPart, whole: Side, highest: float, parity: NDArray[np.bool_]) -> Reals:
    """A body's modes up to a frequency (rad/s), and sums of other trial shapes in which it yields besides, (k, m)."""
    count = int(np.sum(part.own <= highest))
    more = yielding(part, count, whole.stiffness, motions(whole, highest), parity)
    sums = np.concatenate([np.eye(len(part.own))[:, :count], *more], axis=1)
    frequencies = np.sqrt(np.einsum("ij,i->j", sums**2, part.own**2))
    sums *= np.minimum(1.0, HEAVIER * highest / frequencies)
    return sums[:, np.argsort(frequencies, kind="stable")].T


def _eigenvalues(whole: Side, sums: tuple[Reals, ...]) -> NDArray[np.complex128]:
    """Those of what oscillates."""
    *of_shoes, of_drum = sums
    kept = scipy.linalg.block_diag(*(each for own in of_shoes for each in (np.eye(len(COORDINATES)), own.T)), of_drum.T)
    forces = kept.T @ (whole.stiffness - COUPLING * whole.drag) @ kept
    values: Any = np.sqrt(-np.linalg.eigvals(forces / (whole.mass @ kept**2)[:, None]).astype(complex))
    values = np.where(values.imag < 0, -values, values)[values.imag != 0]  # of each two ±λ
    return values - DAMPED * values.imag


def _assembled(scene: Scene) -> tuple[Side, list[BodyPart]]:
    """The frictionless brake over trial shapes, and the parts of its shoes and of the drum."""
    trial = trial_drum(scene)
    of_drum = 2 * np.pi * frequencies_of(scene, "drum", trial)
    places = (getattr(shoe, "position", None) for shoe in scene.shoes)
    sides = [one_side(*each, trial) for each in zip(scene.alone, places, strict=True)]
    ends = np.cumsum([0, *(len(side.mass) - len(of_drum) for side, _ in sides)])
    size = ends[-1] + len(of_drum)
    drum = BodyPart(np.arange(ends[-1], size), of_drum, trial)
    mass, stiffness, drag = np.ones(size), np.zeros((size, size)), np.zeros((size, size))
    stiffness[drum.places, drum.places] = of_drum**2
    parts, loads = [], []
    for first, last, (side, part) in zip(ends[:-1], ends[1:], sides, strict=True):
        places = np.concatenate([np.arange(first, last), drum.places])
        mass[places] = side.mass
        stiffness[np.ix_(places, places)] += side.stiffness
        drag[np.ix_(places, places)] += side.drag
        loads.append(np.zeros((len(side.loads), size)))
        loads[-1][:, places] = side.loads
        parts.append(part._replace(places=first + part.places))
        stiffness[parts[-1].places, parts[-1].places] += part.own**2
    return Side(mass, stiffness, drag, np.concatenate(loads)), [*parts, drum]


def one_side(scene: Scene, position: float | None, drum: Any) -> tuple[Side, BodyPart]:
    """One shoe over its trial shapes and those of the drum under it, and where its own are."""
    shoe = trial_shoe(scene)
    own = 2 * np.pi * frequencies_of(scene, "shoe", shoe)
    value = scene.numbers() | numbers_of_shoe(scene, shoe) | numbers_of_drum(scene, drum)
    value |= {} if position is None else {"shoe.position": position}
    of_drum = 0 if drum is None else len(drum.wavenumbers)
    composition = Composition(
        coordinates=(*COORDINATES, *shape_names(0, len(own)), *shape_names(0, of_drum, DRUM)),
        steady_state=scene.steady.state,
        support=scene.support is not None,
        springs=len(scene.shoe.spring),
        pushes=len(scene.shoe.force),
        symmetric_modes=(False,) * len(own),
        mesh=scene.shoe.solid is not None,
    )
    side = side_of(composition, {key: real(each) for key, each in value.items() if key.startswith(YIELDING)})
    return side, BodyPart(len(COORDINATES) + np.arange(len(own)), own, shoe)
