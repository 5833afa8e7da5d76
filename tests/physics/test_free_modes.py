"""Free modes of a sector against a Ritz method of its own, straight bars and finite differences."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.polynomial import legendre
from scipy.linalg import eigh
from scipy.optimize import brentq

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies import elements, free_modes, mode_shapes
from drumsqueal.physics.bodies.free_modes import find_free_modes
from drumsqueal.physics.bodies.mode_shapes import Sector, nearest_point, shapes_at, shapes_held_at

PAPER = Sector(0.1, 0.02, 0.0365, np.radians(130))
STEEL = np.sqrt(210e9 / 7820)  # m/s
POISSON = 0.3
UP_TO = 2 * np.pi * 12000 / STEEL
# Both Ritz methods are on the stiff side, by some 1e-5 of a frequency.
CLOSE = 1e-4


@pytest.fixture(scope="module")
def paper():
    """Return the free modes of the paper's shoe, of steel, up to 12 kHz."""
    return find_free_modes(PAPER, POISSON, UP_TO)


def line(count):
    """Legendre polynomials and their slopes at Gauss nodes, and the weights."""
    x, weight = legendre.leggauss(count + 4)
    slope = np.stack([legendre.legval(x, legendre.legder(np.eye(count)[k])) for k in range(count)], axis=1)
    return x, weight, legendre.legvander(x, count - 1), slope


def ritz(sector, poisson, degrees):
    """Wavenumbers and Cartesian coefficients (3, polynomials, n) of all modes of u_x, u_y, u_z = Σ c P P P.

    It knows no symmetry and no cylindrical components.
    """
    R, h, b, beta = sector
    lines = [line(count) for count in degrees]
    (xr, wr, Pr, Dr), (xt, wt, Pt, Dt), (xz, wz, Pz, Dz) = lines
    r, angle = R - h / 2 + h / 2 * xr, beta / 2 * xt

    def products(*factors):
        return np.einsum("ia,jb,kc->ijkabc", *factors).reshape(len(xr) * len(xt) * len(xz), -1)

    weight = np.einsum("i,j,k->ijk", wr * r * h / 2, wt * beta / 2, wz * b / 2).ravel()
    radius, turn, _ = (each.reshape(-1, 1) for each in np.meshgrid(r, angle, xz, indexing="ij"))
    value = products(Pr, Pt, Pz)
    by_r, by_angle = products(Dr * 2 / h, Pt, Pz), products(Pr, Dt * 2 / beta, Pz) / radius
    cosine, sine = np.cos(turn), np.sin(turn)
    slopes = [cosine * by_r - sine * by_angle, sine * by_r + cosine * by_angle, products(Pr, Pt, Dz * 2 / b)]
    energy = [[one.T @ (weight[:, None] * other) for other in slopes] for one in slopes]
    first, second = poisson / ((1 + poisson) * (1 - 2 * poisson)), 1 / (2 * (1 + poisson))
    trace = sum(energy[i][i] for i in range(3))
    blocks = [
        [first * energy[i][j] + second * energy[j][i] + (i == j) * second * trace for j in range(3)] for i in range(3)
    ]
    mass = np.kron(np.eye(3), value.T @ (weight[:, None] * value))
    values, vectors = eigh(np.block(blocks), mass, subset_by_index=(6, 17))
    return np.sqrt(values), vectors.reshape(3, *degrees, -1)


def grid(sector, counts=(5, 9, 5)):
    """Points spread over a sector: r, θ, z."""
    R, h, b, beta = sector
    ends = (R - h, R), (-beta / 2, beta / 2), (-b / 2, b / 2)
    axes = (np.linspace(*end, n) for end, n in zip(ends, counts, strict=True))
    return [each.ravel() for each in np.meshgrid(*axes, indexing="ij")]


def scaled(sector, r, angle, z):
    return (
        (r - sector.outer_radius + sector.thickness / 2) * 2 / sector.thickness,
        angle * 2 / sector.arc_angle,
        (z * 2 / sector.width),
    )


@pytest.fixture(scope="module")
def witness():
    """Return what the Ritz method finds; with degrees of 17 in place of 13 its frequencies change by 1e-5."""
    return ritz(PAPER, POISSON, (6, 14, 6))


@pytest.mark.thorough
def test_modes_of_the_papers_shoe_are_those_of_a_ritz_method(paper, witness):
    wavenumbers, shapes = witness
    count = len(paper.wavenumbers)
    assert count == np.sum(wavenumbers < UP_TO) == 6
    np.testing.assert_allclose(paper.wavenumbers, wavenumbers[:count], rtol=CLOSE)
    r, angle, z = grid(PAPER)
    bases = [legendre.legvander(x, n - 1) for x, n in zip(scaled(PAPER, r, angle, z), (6, 14, 6), strict=True)]
    x, y, axial = np.einsum("pa,pb,pc,iabcn->ipn", *bases, shapes[..., :count])
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    expected = np.stack([cosine * x + sine * y, cosine * y - sine * x, axial], axis=1)
    found = shapes_at(paper.coefficients, PAPER, r, angle, z)
    expected = expected * np.sign(np.sum(found * expected, axis=(0, 1)))
    # Both have unit modal mass, so the same size. Shapes err as the root of what frequencies err.
    np.testing.assert_allclose(found, expected, atol=3e-3 * np.max(np.abs(expected)))


@pytest.mark.thorough
def test_frequencies_of_the_papers_shoe_are_near_the_published_ones(paper):
    frequencies = paper.wavenumbers * STEEL / (2 * np.pi)
    np.testing.assert_allclose(frequencies[:4], [2172, 5046, 5972, 6600], rtol=4e-4)  # of finite elements
    assert paper.symmetric == (True, False, True, False, False, True)


@pytest.mark.thorough
def test_further_polynomials_lower_frequencies_by_less_than_they_err(paper, monkeypatch):
    monkeypatch.setattr(mode_shapes, "folder", None)
    found = []
    for more in (2, 6, 8):
        monkeypatch.setattr(free_modes, "MORE_DEGREES", more)
        found.append(free_modes._find(PAPER, POISSON, UP_TO, None).wavenumbers)
    few, usual, many = found
    np.testing.assert_array_equal(usual, paper.wavenumbers)
    assert np.all(few > usual)
    assert np.all(usual >= many * (1 - 1e-9))
    assert np.max(usual / many - 1) < 2e-5


@pytest.fixture(scope="module")
def bar():
    """Return a sector that is nearly a straight bar of 10 by 10 by 200 mm: its modes up to the first axial one."""
    sector = Sector(20.0, 0.01, 0.01, 0.2 / 19.995)
    return sector, find_free_modes(sector, POISSON, 1.02 * np.pi / 0.2)


def timoshenko(length, side, poisson, low, high):
    """Wavenumbers ω sqrt(ρ/E) of bending of a free beam of square section, from equations of the first order."""
    area, inertia = side**2, side**4 / 12
    shear = 10 * (1 + poisson) / (12 + 11 * poisson) * area / (2 * (1 + poisson))  # Cowper 1966, E = 1

    def residual(wavenumber):
        square = wavenumber**2
        # w, turn, moment, force: w' = φ + Q/(κGA), φ' = M/(EI), Q' = −ρAω²w, M' = −Q − ρIω²φ
        system = np.array(
            [[0, 1, 0, 1 / shear], [0, 0, 1 / inertia, 0], [0, -square * inertia, 0, -1], [-square * area, 0, 0, 0]]
        )
        values, vectors = np.linalg.eig(system)
        across = (vectors * np.exp(values * length)) @ np.linalg.inv(vectors)
        return np.linalg.det(across[2:, :2]).real

    at = np.linspace(low, high, 2000)
    signs = np.sign([residual(each) for each in at])
    turns = np.flatnonzero(signs[1:] != signs[:-1])
    return np.array([brentq(residual, at[k], at[k + 1]) for k in turns])


@pytest.mark.thorough
def test_a_nearly_straight_bar_bends_twists_and_stretches_as_beams_do(bar):
    sector, modes = bar
    length, side = 0.2, 0.01
    bending = timoshenko(length, side, POISSON, 0.5, 1.02 * np.pi / length)
    torsion = np.pi / length * np.sqrt(0.140577 * 6 / (2 * (1 + POISSON)))  # Saint-Venant's square: J = 0.140577 a⁴
    stretching = np.pi / length * (1 - (POISSON * np.pi / length) ** 2 * side**2 / 6 / 2)  # Rayleigh and Love
    expected = np.sort([*bending, *bending, torsion, stretching])
    assert len(bending) == 4
    # Twice the change by the last mesh, four times where the beam itself is approximate: the fourth bends shortest.
    np.testing.assert_allclose(modes.wavenumbers, expected, rtol=2e-3)
    pure = [np.argmin(np.abs(modes.wavenumbers - each)) for each in (torsion, stretching)]
    np.testing.assert_allclose(modes.wavenumbers[pure], [torsion, stretching], rtol=1e-3)
    assert [modes.symmetric[k] for k in pure] == [False, True]
    # A bar that twists bends by L/R = 1/100 of that, being curved; one that stretches moves its ends by sqrt(2/V).
    ends = shapes_at(modes.coefficients, sector, 20.0 - side / 2, np.array([-1, 1]) * sector.arc_angle / 2, 0.0)
    np.testing.assert_allclose(ends[:, :, pure[0]], 0, atol=5e-3 * np.sqrt(2 / (length * side**2)))
    np.testing.assert_allclose(np.abs(ends[:, 1, pure[1]]), np.sqrt(2 / (length * side**2)), rtol=1e-3)
    assert ends[0, 1, pure[1]] == pytest.approx(-ends[1, 1, pure[1]], rel=1e-9)


def test_shapes_are_orthonormal_and_hold_no_rigid_motion(paper):
    R, h, b, beta = PAPER
    rules = [legendre.leggauss(n) for n in (10, 32, 12)]
    r, angle, z = (each.ravel() for each in np.meshgrid(*(x for x, _ in rules), indexing="ij"))
    r, angle, z = R - h / 2 + h / 2 * r, angle * beta / 2, z * b / 2
    weight = np.einsum("i,j,k->ijk", *(w for _, w in rules)).ravel() * r * h * beta * b / 8
    shapes = shapes_at(paper.coefficients, PAPER, r, angle, z)
    gram = np.einsum("pim,pin,p->mn", shapes, shapes, weight)
    np.testing.assert_allclose(gram, np.eye(len(gram)), atol=1e-12)
    cosine, sine, none = np.cos(angle), np.sin(angle), 0 * angle
    rigid = [
        (cosine, -sine, none),
        (sine, cosine, none),
        (none, none, none + 1),
        (-z * sine, -z * cosine, r * sine),
        (z * cosine, -z * sine, -r * cosine),
        (none, r, none),
    ]
    sizes = np.sqrt([np.einsum("ip,ip,p", np.array(each), np.array(each), weight) for each in rigid])
    products = np.einsum("qip,pin,p->qn", np.array(rigid), shapes, weight) / sizes[:, None]
    # A cosine over 130° is a polynomial of degree 15 to 1e-13; weighted by r, and of the nodes.
    np.testing.assert_allclose(products, 0, atol=1e-9)


def test_shapes_are_even_or_odd_in_both_planes_to_all_digits(paper):
    r, angle, z = grid(PAPER)
    shapes, mirrored, across = (
        shapes_at(paper.coefficients, PAPER, r, s * angle, t * z) for s, t in ((1, 1), (-1, 1), (1, -1))
    )
    in_z = np.where(paper.symmetric, 1, -1) * np.array([1, 1, -1])[:, None]
    scale = np.max(np.abs(shapes))
    np.testing.assert_allclose(across, in_z * shapes, atol=1e-12 * scale)
    u_r, mirrored_u_r = shapes[:, 0], mirrored[:, 0]
    sign = np.sign(np.sum(u_r * mirrored_u_r, axis=0))
    np.testing.assert_allclose(mirrored, sign * np.array([1, -1, 1])[:, None] * shapes, atol=1e-12 * scale)


def test_signs_are_settled_by_the_linings_corner(paper):
    corner = shapes_at(paper.coefficients, PAPER, PAPER.outer_radius, PAPER.arc_angle / 2, PAPER.width / 2)
    moves = np.abs(corner) > 0.1 * np.max(np.abs(corner), axis=0)
    assert np.all(corner[np.argmax(moves, axis=0), np.arange(corner.shape[1])] > 0)


# On the shoe, beyond the lining, inwards, beside it, beyond either end, behind the drum's axis and on it (m).
POINTS = [
    (0.09, 0.02, 0.01),
    (0.05, -0.1, -0.004),
    (0.03, 0.01, 0.03),
    (-0.02, 0.09, 0.0),
    (-0.01, -0.12, -0.03),
    (-0.09, 0.001, 0.02),
]


@pytest.mark.parametrize("point", POINTS)
def test_the_nearest_point_of_the_shoe_is_nearest(point):
    r, angle, z = nearest_point(PAPER, *point)
    found = np.linalg.norm(np.array(point) - [r * np.cos(angle), r * np.sin(angle), z])
    many_r, many_angle, many_z = grid(PAPER, (21, 401, 41))
    others = np.stack([many_r * np.cos(many_angle), many_r * np.sin(many_angle), many_z], axis=1)
    nearest = np.min(np.linalg.norm(np.array(point) - others, axis=1))
    assert nearest - 1e-3 < found <= nearest + 1e-15  # 1 mm: the distance of those others
    assert PAPER.outer_radius - PAPER.thickness - 1e-15 <= r <= PAPER.outer_radius + 1e-15


def patch_of(sector, point, radius, nodes):
    """Places (3, k) in a box around a sector's nearest point, as far as it is in the sector, and their weights (k,)."""
    R, h, b, beta = sector
    r, angle, z = nearest_point(sector, *point)
    x, w = legendre.leggauss(nodes)
    ends = (r, radius, R - h, R), (angle, radius / r, -beta / 2, beta / 2), (z, radius, -b / 2, b / 2)
    clipped = [(max(middle - half, low), min(middle + half, high)) for middle, half, low, high in ends]
    r, angle, z = np.meshgrid(*((low + high) / 2 + (high - low) / 2 * x for low, high in clipped), indexing="ij")
    weight = r * w[:, None, None] * w[:, None] * w
    places = np.stack([r * np.cos(angle), r * np.sin(angle), z]).reshape(3, -1)
    return places, weight.ravel() / np.sum(weight)


@pytest.mark.parametrize("radius", [0.0, 1e-3, 6e-3])
@pytest.mark.parametrize("point", POINTS)
def test_a_point_off_the_shoe_is_held_by_rigid_arms_from_a_patch(paper, point, radius):
    # The linear motion nearest to the patch's, by least squares; of a point, that of central differences in Cartesian
    # coordinates. The polynomials go on beyond the sector.
    coefficients = paper.coefficients[:4]
    feet, weights = patch_of(PAPER, point, radius, 6 if radius else 1)

    def cartesian(x, y, z):
        turn = np.arctan2(y, x)
        u = np.moveaxis(shapes_at(coefficients, PAPER, np.hypot(x, y), turn, z), 0, -1)
        return np.stack([np.cos(turn) * u[0] - np.sin(turn) * u[1], np.sin(turn) * u[0] + np.cos(turn) * u[1], u[2]])

    moved, step = cartesian(*feet), 1e-6  # (3, modes, points)
    if radius:
        root = np.sqrt(weights)[:, None]
        rows = root * np.hstack([np.ones((feet.shape[1], 1)), (feet - feet @ weights[:, None]).T])
        fits = [np.linalg.lstsq(rows, root * each.T)[0] for each in moved]  # (4, modes) of each direction
        slopes = [np.stack([fit[1 + k] for fit in fits]) for k in range(3)]
    else:
        shifted = [(feet + step * e[:, None], feet - step * e[:, None]) for e in np.eye(3)]
        slopes = [((cartesian(*ahead) - cartesian(*behind)) / (2 * step))[..., 0] for ahead, behind in shifted]
    curl = np.stack([slopes[1][2] - slopes[2][1], slopes[2][0] - slopes[0][2], slopes[0][1] - slopes[1][0]])
    expected = moved @ weights + np.cross(curl / 2, (np.array(point) - feet @ weights)[:, None], axis=0)
    found = shapes_held_at(coefficients, PAPER, *point, radius=radius)
    # A point is a patch of 0.1 µm, in which round-off is 1e-7 of slopes, and whose middle is half of that within the
    # shoe. Over 12 mm three Gauss points miss the sixth derivative of the modes, and six do not.
    bound = {0.0: 1e-5, 1e-3: 1e-7, 6e-3: 1e-5}[radius]
    np.testing.assert_allclose(found, expected, atol=bound * np.max(np.abs(expected)))


def test_a_rigid_turn_takes_held_points_along():
    # u = ω × x with ω = (0, 0, 1): u_θ = r, a polynomial.
    coefficients = np.zeros((1, 3, 2, 1, 1))
    coefficients[0, 1, :, 0, 0] = PAPER.outer_radius - PAPER.thickness / 2, PAPER.thickness / 2
    for x, y, z in POINTS:
        for radius in (0.0, 2e-3, 0.5):
            found = shapes_held_at(coefficients, PAPER, x, y, z, radius)[:, 0]
            np.testing.assert_allclose(found, [-y, x, 0], atol=1e-15)


@pytest.mark.parametrize("angle", [0.0, PAPER.arc_angle / 2], ids=["within", "at the end"])
def test_the_mean_of_a_stretch_is_that_of_the_middle_of_what_is_left_of_the_patch(angle):
    # u_z = z²: Σ c P with z = ζ b/2 and z² = (b/2)² (P_0 + 2 P_2)/3; its mean over [z0 − a, b/2] is a closed form, and
    # curl is 0 but along x and y.
    half, radius = PAPER.width / 2, 4e-3
    coefficients = np.zeros((1, 3, 1, 1, 3))
    coefficients[0, 2, 0, 0, ::2] = half**2 * np.array([1, 2]) / 3
    r, z = PAPER.outer_radius - PAPER.thickness / 2, half - 1e-3
    found = shapes_held_at(coefficients, PAPER, r * np.cos(angle), r * np.sin(angle), z, radius)[:, 0]
    wanted = (half**3 - (z - radius) ** 3) / 3 / (half - z + radius)
    np.testing.assert_allclose(found, [0, 0, wanted], rtol=1e-13, atol=1e-18)
    # u_r = r, a stretch without a turn: the mean of r over the arc of the patch, by its closed form.
    coefficients = np.zeros((1, 3, 2, 1, 1))
    coefficients[0, 0, :, 0, 0] = r, PAPER.thickness / 2
    found = shapes_held_at(coefficients, PAPER, r * np.cos(angle), r * np.sin(angle), 0.0, radius)[:, 0]
    low, high = r - radius, r + radius
    mean = (high**3 - low**3) / 3 / ((high**2 - low**2) / 2)
    ends = angle - radius / r, min(angle + radius / r, PAPER.arc_angle / 2)
    along = mean * np.array([np.sin(ends[1]) - np.sin(ends[0]), np.cos(ends[0]) - np.cos(ends[1]), 0])
    # Three Gauss points miss the sixth power of the angle over the patch, some 0.1.
    np.testing.assert_allclose(found, along / (ends[1] - ends[0]), rtol=1e-11, atol=1e-15)


@pytest.mark.thorough
def test_jax_traces_and_differentiates_what_numpy_evaluates(paper):
    numbers = shapes_at(paper.coefficients, PAPER, 0.1, 0.5, np.array([0.0, 0.01]))
    assert isinstance(numbers, np.ndarray)
    assert numbers.shape == (2, 3, len(paper.wavenumbers))
    traced = jax.jit(lambda angle: shapes_at(paper.coefficients, PAPER, 0.1, angle, jnp.array([0.0, 0.01])))
    np.testing.assert_allclose(traced(0.5), numbers, rtol=1e-12, atol=1e-12)
    scaled = jax.jit(lambda c: shapes_held_at(c, PAPER, 0.05, -0.1, 0.0))(2 * jnp.asarray(paper.coefficients))
    held_there = 2 * shapes_held_at(paper.coefficients, PAPER, 0.05, -0.1, 0.0)
    round_off = 1e-15 * np.abs(held_there).max()
    np.testing.assert_allclose(scaled, held_there, rtol=1e-10, atol=round_off)
    at = np.array([0.05, 2e-3])  # x, and the radius of a patch that ends with the sector

    def held(at):
        return shapes_held_at(paper.coefficients, PAPER, at[0], -0.1, 0.0, at[1])

    slope = np.asarray(jax.jit(jax.jacfwd(held))(at))
    for k in range(2):
        ahead, behind = (held(at + s * np.eye(2)[k]) for s in (1e-6, -1e-6))
        np.testing.assert_allclose(slope[..., k], (ahead - behind) / 2e-6, atol=1e-6 * np.max(np.abs(slope[..., k])))


SMALL = (PAPER, POISSON, 2 * np.pi * 3000 / STEEL)  # one mode


@pytest.fixture
def solved(monkeypatch, tmp_path):
    """Return a list that grows with every parity that is solved; modes are kept in an empty folder."""
    parities, of_parity = [], free_modes._of_parity

    def solve(parity, *others):
        parities.append(parity)
        return of_parity(parity, *others)

    monkeypatch.setattr(mode_shapes, "folder", tmp_path / "kept")
    monkeypatch.setattr(free_modes, "_of_parity", solve)
    monkeypatch.setattr(free_modes, "MORE_DEGREES", 4)  # small matrices, by which frequencies err by some per cent
    monkeypatch.setattr(free_modes, "SHORTEST_WAVE", 1e3)
    find_free_modes.cache_clear()
    yield parities
    find_free_modes.cache_clear()


def test_modes_are_found_once_and_kept(solved, tmp_path):
    first = find_free_modes(*SMALL)
    assert len(solved) == 4
    assert find_free_modes(*SMALL) is first
    with pytest.raises(ValueError, match="read-only"):
        first.wavenumbers[0] = 0.0
    find_free_modes.cache_clear()
    again = find_free_modes(*SMALL)
    assert len(solved) == 4
    np.testing.assert_array_equal(again.coefficients, first.coefficients)
    np.testing.assert_array_equal(again.wavenumbers, first.wavenumbers)
    assert again.symmetric == first.symmetric == (True,)
    (kept,) = (tmp_path / "kept").iterdir()
    for damage in (b"", kept.read_bytes()[:-20], b"x" + kept.read_bytes()[1:], b"nonsense"):
        kept.write_bytes(damage)
        find_free_modes.cache_clear()
        before = len(solved)
        np.testing.assert_array_equal(find_free_modes(*SMALL).coefficients, first.coefficients)
        assert len(solved) > before
        assert [each.name for each in kept.parent.iterdir()] == [kept.name]


@pytest.mark.parametrize("changed", range(6))
def test_other_numbers_are_other_modes(changed, tmp_path, monkeypatch):
    monkeypatch.setattr(mode_shapes, "folder", tmp_path / "kept")
    known = [*PAPER, *SMALL[1:]]
    numbers = list(known)
    numbers[changed] = np.nextafter(numbers[changed], 1e9)
    one, other = (mode_shapes.kept_at("sector", each) for each in (known, numbers))
    assert one is not None
    assert one != other


def test_what_yields_at_other_patches_is_kept_apart(monkeypatch):
    told, few = [], free_modes.FreeModes(np.zeros(1), np.zeros((1, 3, 1, 1, 1)), (True,))
    monkeypatch.setattr(free_modes, "kept", lambda what, each, find: told.append(each) or vars(few))
    find_free_modes.cache_clear()
    asked = (None, (), ((0.09, 0.0, 0.0, 1e-3),), ((0.09, 0.0, 0.0, 2e-3),), ((0.0, 0.0, 0.0, 0.0),))
    for patches in asked:
        find_free_modes(*SMALL, patches)
    find_free_modes.cache_clear()
    assert len(set(told)) == len(asked)


@pytest.mark.thorough
def test_what_yields_at_mirrored_patches_is_the_mirror_image():
    """As found of patches of their own, where shapes of the same wavenumber do not mix."""
    patches = ((0.085, -0.03, 0.004, 0.002), (0.09, 0.01, 0.0, 0.003))
    found, direct = find_free_modes(*SMALL, patches), free_modes._find(PAPER, POISSON, SMALL[-1], patches)
    np.testing.assert_allclose(found.wavenumbers, direct.wavenumbers, rtol=1e-9)
    assert found.symmetric == direct.symmetric
    # Stiff shapes are the answers to loads that differ by little, and 1e-4 of them is round-off.
    modes = found.wavenumbers < 3 * UP_TO
    assert modes.sum() > 10
    size = np.max(np.abs(direct.coefficients[modes]))
    np.testing.assert_allclose(found.coefficients[modes], direct.coefficients[modes], rtol=0, atol=1e-8 * size)


def test_a_folder_that_cannot_be_written_costs_only_time(solved, tmp_path):
    (tmp_path / "kept").write_text("a file in the place of the folder")
    assert len(find_free_modes(*SMALL).wavenumbers) == 1
    assert len(solved) == 4


def test_below_the_first_mode_there_is_none(solved):
    modes = find_free_modes(PAPER, POISSON, 2 * np.pi * 1500 / STEEL)
    assert len(solved) == 4
    assert modes.wavenumbers.shape == (0,)
    assert modes.symmetric == ()
    assert shapes_at(modes.coefficients, PAPER, 0.1, np.zeros(4), 0.0).shape == (4, 3, 0)
    assert shapes_held_at(modes.coefficients, PAPER, 0.05, -0.1, 0.0).shape == (3, 0)


def test_too_much_is_refused_before_anything_is_solved(solved, monkeypatch):
    monkeypatch.undo()
    monkeypatch.setattr(free_modes, "_energies", lambda *_: pytest.fail("something is solved"))
    # Some 480 modes: 50 kHz in a plate of 4 mm that goes nearly round.
    with pytest.raises(
        RequestError, match=r"some \d+ free modes up to twice shoe.elastic.up_to, .* at most 400 .* \d+ % of"
    ):
        find_free_modes(Sector(0.1, 0.004, 0.2, np.radians(340)), POISSON, 2 * np.pi * 50000 / STEEL)
    with pytest.raises(RequestError, match=r"take \d+ products of polynomials, and at most .*; lower .* to \d+ % of"):
        find_free_modes(PAPER, POISSON, 2 * np.pi * 200000 / STEEL)
    monkeypatch.setattr(free_modes, "MOST_UNKNOWNS", 50)
    with pytest.raises(RequestError, match=r"; make the shoe less slender$"):
        find_free_modes(Sector(0.1, 0.0001, 0.02, np.radians(130)), POISSON, 0.05)
    with pytest.raises(RequestError, match=r"ratio is 0\.5"):
        find_free_modes(PAPER, 0.5, UP_TO)


def test_a_shoe_whose_rigid_motions_drown_its_modes_is_refused(solved, monkeypatch):
    monkeypatch.setattr(elements, "RIGID", 0.0)
    with pytest.raises(ArithmeticError, match="lost in round-off"):
        find_free_modes(*SMALL)
    assert len(solved) == 1


def test_more_modes_than_expected_are_all_found(monkeypatch):
    monkeypatch.setattr(free_modes, "MORE_DEGREES", 2)
    found = []
    for first in (1, 40):
        monkeypatch.setattr(free_modes, "FIRST_ASKED", first)
        found.append(free_modes._find(PAPER, POISSON, 4 * UP_TO, None).wavenumbers)
    assert len(found[0]) > 20  # each parity has more than are asked for at first
    np.testing.assert_allclose(*found, rtol=1e-9)


@pytest.mark.parametrize("parity", free_modes.PARITIES)
def test_rigid_motions_of_a_parity_strain_nothing(parity):
    degrees = (2, 20, 2)
    stiffness, mass, places = free_modes._energies(PAPER, POISSON, degrees, parity)
    every = free_modes._rigid_motions(PAPER, degrees)
    mine = every[places]
    mine = mine[:, np.any(mine != 0, axis=0)]
    assert mine.shape[1] == (1 if parity.in_z == parity.in_angle else 2)  # X; Y and Tz; Z and Ty; Tx
    stretch = 1 / PAPER.outer_radius**2 * np.sum(mine * (mass @ mine), axis=0)
    # Cosines over 130° are polynomials of degree 19 to round-off.
    assert np.max(np.abs(np.sum(mine * (stiffness @ mine), axis=0)) / stretch) < 1e-12
    assert every.shape[1] == 6


# Fields (u_r, u_θ, u_z) that polynomials hold, and their strains rr, θθ, zz, rθ, θz, zr, by hand.
FIELDS = {
    "wider": (lambda r, t, z: (r, 0, 0), lambda r, t, z: (1, 1, 0, 0, 0, 0)),
    "twisted": (lambda r, t, z: (0, r * z, 0), lambda r, t, z: (0, 0, 0, 0, r, 0)),
    "sheared": (lambda r, t, z: (z, 0, 0), lambda r, t, z: (0, z / r, 0, 0, 0, 1)),
    "opened": (lambda r, t, z: (0, r * t, 0), lambda r, t, z: (0, 1, 0, 0, 0, 0)),
    "bulged": (lambda r, t, z: (t**2, 0, z * r), lambda r, t, z: (0, t**2 / r, r, 2 * t / r, 0, z)),
    "warped": (lambda r, t, z: (0, z, r * t), lambda r, t, z: (0, 0, 0, -z / r, 1 + 1, t)),
}


@pytest.mark.parametrize("name", FIELDS)
def test_energies_are_those_of_the_strains(name):
    field, strains = FIELDS[name]
    degrees, rules = (3, 4, 3), [legendre.leggauss(n) for n in (30, 20, 20)]
    R, h, b, beta = PAPER
    halves = h / 2, beta / 2, b / 2
    places = [middle + half * x for middle, half, (x, _) in zip((R - h / 2, 0, 0), halves, rules, strict=True)]
    r, angle, z = np.meshgrid(*places, indexing="ij")
    into = [
        legendre.legvander(x, n - 1) * w[:, None] * (np.arange(n) + 0.5)
        for n, (x, w) in zip(degrees, rules, strict=True)
    ]
    fields = np.stack([each + 0 * r for each in field(r, angle, z)])
    coefficients = np.einsum("cijl,ia,jb,lk->cabk", fields, *into).ravel()
    volume = np.einsum("i,j,k->ijk", *(half * w for half, (_, w) in zip(halves, rules, strict=True))) * r
    strain = np.stack([each + 0 * r for each in strains(r, angle, z)])
    first, second = POISSON / ((1 + POISSON) * (1 - 2 * POISSON)), 1 / (2 * (1 + POISSON))
    density = first * strain[:3].sum(axis=0) ** 2 + 2 * second * (strain[:3] ** 2).sum(axis=0)
    density += second * (strain[3:] ** 2).sum(axis=0)
    energies = np.zeros(2)
    for parity in free_modes.PARITIES:
        stiffness, mass, places = free_modes._energies(PAPER, POISSON, degrees, parity)
        mine = coefficients[places]
        energies += mine @ stiffness @ mine, mine @ (mass @ mine)
    wanted = np.sum(density * volume), np.sum(fields**2 * volume)
    np.testing.assert_allclose(energies, wanted, rtol=1e-12)
