"""Contact forces of an elastic shoe without the code of the package, and states of it at random."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from numpy.polynomial import legendre

from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.bodies.body import scalars, whole
from drumsqueal.scene import COORDINATES
from whole_shoe import Brake


def polynomials(places, coefficients):
    """Return u_r, u_θ, u_z (3, n, points) of shapes at scaled places: Legendre's, one coefficient after the other."""
    bases = [legendre.legvander(x, n - 1) for x, n in zip(places, coefficients.shape[2:], strict=True)]
    return np.einsum("pa,pb,pc,jiabc->ijp", *bases, coefficients, optimize=True)


def lining_shapes(body, theta, z):
    """Return u_r, u_θ, u_z (3, n, points) of the lining for 1 of each coordinate, by section 2 and by polynomials.

    z is that of each point, or of all.
    """
    R, b, c = (float(each) for each in (body.outer_radius, body.width, body.centroid))
    shapes = np.sum(np.asarray(body.shapes), axis=2)  # Legendre polynomials are 1 at the lining
    around, across = (
        legendre.legvander(x, n - 1)
        for x, n in zip((2 * theta / float(body.arc_angle), 2 * z / b), shapes.shape[2:], strict=True)
    )
    modal = np.einsum(f"pb,{'p' if np.ndim(z) else 'q'}c,jibc->ijp", around, across, shapes, optimize=True)
    z = z + 0 * theta
    zero, one, ahead = 0 * theta, 1 + 0 * theta, R * np.cos(theta) - c
    x = {"X": one, "Ty": z, "Tz": -R * np.sin(theta)}
    y = {"Y": one, "Tx": -z, "Tz": ahead}
    axial = {"Z": one, "Tx": R * np.sin(theta), "Ty": -ahead}
    names = [name for name in body.names if name in COORDINATES]
    x, y, axial = (np.array([each.get(name, zero) for name in names]) for each in (x, y, axial))
    rigid = np.stack([x * np.cos(theta) + y * np.sin(theta), y * np.cos(theta) - x * np.sin(theta), axial])
    return np.concatenate([rigid, modal, -drum_shapes(body, theta, z)], axis=1)


def drum_shapes(body, theta, z):
    """Return u_r, u_θ, u_z (3, m, points) of a drum's inner surface: waves around, polynomials along z."""
    if body.drum is None:
        return np.zeros((3, 0, theta.size))
    shapes, half = np.asarray(body.drum.shapes), float(body.drum.width) / 2
    waves = [(np.sin if k % 2 == 0 and k else np.cos)((k + 1) // 2 * theta) for k in range(shapes.shape[2])]
    values = legendre.legval((z - float(body.drum.offset)) / half + 0 * theta, np.moveaxis(shapes, -1, 0))
    return np.einsum("jifp,fp->ijp", values, waves)


def brute_force(model, q, v, panels=5, samples=200):
    """Return the generalised contact force of section 3, by Gauss's rule between the boundaries on each of many lines.

    Lines are Gauss's in panels, so that kinks where boundaries enter cost a power of 5/2 of their distance. On each the
    roots of pressure and of slip are bisected, and pieces halve towards both, as |V| has branch points near them; all
    pieces are short, as |V| may be small where no line has a root.
    """
    brake = Brake()
    body, R, half = model.shoe, float(model.shoe.outer_radius), float(model.shoe.arc_angle) / 2
    p0 = brake.load / (2 * half * R * float(body.width))

    def fields(theta, z):
        shapes = lining_shapes(body, theta, z)
        return shapes, p0 + brake.contact * q @ shapes[0], v @ shapes[1] - R * brake.speed, v @ shapes[2]

    def roots(which):
        """Places of the roots of a level, each on its line."""
        theta, z = (each.ravel() for each in np.meshgrid(at, heights))
        signs = np.sign(fields(theta, z)[which]).reshape(len(heights), -1)
        line, k = np.nonzero(signs[:, 1:] * signs[:, :-1] < 0)
        low, high = at[k], at[k + 1]
        for _ in range(50):
            middle = (low + high) / 2
            same = np.sign(fields(middle, heights[line])[which]) == signs[line, k]
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        return line, low

    (x, weight), (inner, share) = legendre.leggauss(10), legendre.leggauss(10)
    heights = (np.linspace(-1, 1, panels, endpoint=False)[:, None] + (x + 1) / panels).ravel() * float(body.width) / 2
    widths = np.tile(weight / panels, panels) * float(body.width) / 2
    at, halved = np.linspace(-half, half, samples), half * 0.5 ** np.arange(30)
    found = [roots(which) for which in (1, 2)]
    total = np.zeros(len(body.names))
    for k, (z, across) in enumerate(zip(heights, widths, strict=True)):
        towards = np.concatenate([place[line == k] for line, place in found])[:, None]
        breaks = np.concatenate([at, towards.ravel(), (towards - halved).ravel(), (towards + halved).ravel()])
        breaks = np.unique(np.clip(np.append(breaks, half), -half, half))
        sizes = np.diff(breaks) / 2
        theta = (breaks[:-1, None] + sizes[:, None] * (1 + inner)).ravel()
        shapes, level, along, axial = fields(theta, z)
        speed = np.hypot(along, axial)
        pressure = np.maximum(level, 0) * (sizes[:, None] * share).ravel() * R * across
        drag = (brake.kinetic + (brake.static - brake.kinetic) * np.exp(-brake.decay * speed)) * pressure / speed
        total -= shapes[0] @ pressure + shapes[1] @ (drag * along) + shapes[2] @ (drag * axial)
    return total


def contact_force(model, *, often=True):
    """Return the contact's generalised force as a function of displacement and velocity; compiled to be asked often."""

    force = _compiled if often else _interpreted
    return lambda q, v: np.asarray(force(model, jnp.asarray(q), jnp.asarray(v)))


def _contact_force(model, q, v):
    return whole(model.contact.act(model.operation.at(0.0), scalars(q), scalars(v)).force)


_compiled, _interpreted = eqx.filter_jit(_contact_force), Interpreted(_contact_force)


def characteristic_lengths(model):
    found = model.shoe.characteristic_lengths()
    return np.array([found[name] for name in model.names])


def random_state(model, seed, size, speed):
    """Return amplitudes that move points of the lining by a size (m) and a speed (m/s) at most, of each coordinate."""
    random = np.random.default_rng(seed)
    return (each * random.uniform(-1, 1, len(model.names)) / characteristic_lengths(model) for each in (size, speed))
