"""What a scene calls for: which coordinates and effects are in its model, and which are left out."""

from drumsqueal.coordinates import in_order, is_elastic, is_of_drum, is_static, shoe_of
from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies.rigid_shoe import IN_PLANE
from drumsqueal.physics.elasticity import (
    count_modes,
    drum_names,
    elastic_frequencies,
    elastic_names,
    resolved,
    symmetric_modes,
    up_to_of,
)
from drumsqueal.physics.quadrature.arc import LONG_ARC
from drumsqueal.physics.shoe_building import Composition, ShoeComposition
from drumsqueal.scene import COORDINATES, Scene, SceneError
from drumsqueal.scene.shoes import OWN


def compose(scene: Scene, coordinates: tuple[str, ...] | None = None) -> Composition:
    """Read off a scene which effects its transient calls for, and which coordinates unless others are asked for."""
    scene = resolved(scene)
    _check_modes_named(scene)
    names = kept_coordinates(scene) if coordinates is None else coordinates
    return _compose_several(scene, names) if scene.several else _compose_one(scene, names)


def _compose_one(scene: Scene, coordinates: tuple[str, ...]) -> Composition:
    friction = scene.friction
    return Composition(
        coordinates=coordinates,
        long_arc=scene.shoe.arc_angle > LONG_ARC,
        separation=scene.contact.separation,
        friction_law=None if friction is None else friction.law,
        friction_direction=None if friction is None else friction.direction,
        steady_state=scene.steady.state,
        support=scene.support is not None,
        damping=scene.damping is not None,
        temperature=scene.temperature is not None,
        forced=forced_coordinates(scene),
        springs=len(scene.shoe.spring),
        pushes=len(scene.shoe.force),
        planar=scene.planar,
        symmetric_modes=symmetric_modes(scene),
        mesh=scene.shoe.solid is not None,
    )


def _compose_several(scene: Scene, coordinates: tuple[str, ...]) -> Composition:
    """Those of each shoe; what is asked of the brake as a whole is that of the first."""
    if not drum_names(scene):
        _check_modes_kept(scene)
        alone = " and ".join(f"--set shoe={name}" for name in scene.shoe_names)
        raise RequestError(
            f"the drum does not bend, so that its shoes do not feel each other: each is a problem of its own, {alone}; "
            "for the brake as a whole add a table [drum.elastic]"
        )
    shoes = []
    for k, (prefix, one) in enumerate(zip(scene.prefixes, scene.alone, strict=True)):
        own = tuple(key for key in OWN if getattr(scene.shoes[k], key) is not None)
        shoes.append(ShoeComposition(k, prefix, own, _compose_one(one, ())._replace(forced=())))
    first = shoes[0].composition
    forced = forced_coordinates(scene)
    return first._replace(coordinates=coordinates, forced=forced, planar=False, shoes=tuple(shoes))


def _check_modes_kept(scene: Scene) -> None:
    """Raise RequestError for a drum that bends, and none of whose modes lies low enough to be kept."""
    key, drum = scene.elastic_table("drum")
    if drum is None:
        return
    kept = up_to_of(scene, "drum")
    up_to, found = kept, []
    while not found:
        up_to *= 2
        wider = scene.with_values({f"{key}.up_to": up_to})
        found = elastic_frequencies(wider, "drum")[: count_modes(wider, "drum")]
    raise RequestError(
        f"{key}.up_to = {kept:g} Hz: no mode of the drum lies below it, and the lowest is at {found[0]:.4g} Hz; "
        "raise it above that"
    )


def _check_modes_named(scene: Scene) -> None:
    """Raise SceneError where a mode is started, forced or listed that the shoe or the drum does not have."""
    simulate = scene.simulate
    listed = () if simulate.coordinates == "auto" else simulate.coordinates
    known = coordinates_of(scene)
    for path, names in {**scene.by_coordinate, ("simulate", "coordinates"): listed}.items():
        for name in names:
            if name not in known:
                number = 0 if is_of_drum(name) else scene.prefixes.index(shoe_of(name))
                body, kind = ("drum", "mode") if is_of_drum(name) else ("shoe", "free mode")
                table, _ = scene.alone[number].elastic_table(body)
                up_to = up_to_of(scene.alone[number], body)
                if body == "shoe" and scene.several:
                    body, table = f"{scene.shoe_names[number]} shoe", scene.key_of(number, table)
                own = [
                    each for each in known if is_elastic(each) and each.rpartition(".")[0] == name.rpartition(".")[0]
                ]
                modes, static = ([each for each in own if is_static(each) == still] for still in (False, True))
                reason = f"the {body} has {_counted(modes, kind)} up to {up_to:g} Hz"
                reason += f", and yields in {_counted(static, 'shape')} besides" if static else ""
                raise SceneError(
                    f"{reason}; raise {table}.up_to, or leave out {name}",
                    path if path[0] == "simulate" else (*path, name),
                )


def _counted(names: list[str], what: str) -> str:
    which = f" ({' to '.join(dict.fromkeys((names[0], names[-1])))})" if names else ""
    return f"{len(names) or 'no'} {what}{'s' * (len(names) > 1)}{which}"


def coordinates_of(scene: Scene) -> tuple[str, ...]:
    """All coordinates that the scene's bodies have: the rigid ones, then the shoe's elastic ones, then the drum's."""
    alone = zip(scene.prefixes, resolved(scene).alone, strict=True)
    of_shoes = (f"{prefix}{name}" for prefix, one in alone for name in (*COORDINATES, *elastic_names(one)))
    return *of_shoes, *drum_names(scene)


def plane_of(scene: Scene) -> tuple[str, ...]:
    """Those of them that move every line across the lining alike, see `Body.symmetric`: none of an elastic drum's."""
    alone = zip(scene.prefixes, resolved(scene).alone, strict=True)
    return tuple(
        f"{prefix}{name}" for prefix, one in alone for name in (*IN_PLANE, *elastic_names(one, symmetric=True))
    )


def kept_coordinates(scene: Scene) -> tuple[str, ...]:
    """Coordinates that can move: those listed, or for "auto" the plane's unless something moves out of it."""
    if scene.simulate.coordinates != "auto":
        listed = scene.simulate.coordinates
        return tuple(name for name in coordinates_of(scene) if name in listed)
    plane = plane_of(scene)
    return plane if scene.planar and moved_coordinates(scene) <= set(plane) else coordinates_of(scene)


def moved_coordinates(scene: Scene) -> set[str]:
    """Coordinates that the start or a force sets in motion by itself."""
    tables = (scene.start.displacement, scene.start.velocity)
    return {name for table in tables for name, value in table.items() if value != 0} | set(forced_coordinates(scene))


def forced_coordinates(scene: Scene) -> tuple[str, ...]:
    """Coordinates that a harmonic force acts on, in their order."""
    amplitude = {} if scene.forcing is None else scene.forcing.amplitude
    return in_order(name for name, value in amplitude.items() if value != 0)


def linear_coordinates(scene: Scene) -> tuple[str, ...]:
    """Coordinates of the eigenvalue problem: those listed, or all: a mode is unstable whether started or not."""
    return coordinates_of(scene) if scene.simulate.coordinates == "auto" else kept_coordinates(scene)
