"""Universal file format: header, units and geometry, the modes, then a dataset 58 for each signal.

Datasets 151 (header), 164 (units), 2420 (coordinate systems), 2411 (nodes), 82 (trace line), 55 (a complex mode each)
and 58 (function at nodal DOF). Source: the definitions by SDRC, as kept by the University of Cincinnati.
"""

import itertools
import unicodedata
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyuff
from numpy.typing import NDArray

from drumsqueal.coordinates import is_elastic, unit_of
from drumsqueal.files.universal import SI_SYSTEM, TIME_AXIS, TIME_RESPONSE, type_of
from drumsqueal.physics.bodies.brake import Placed, placed, turned
from drumsqueal.physics.bodies.drum_modes import ElasticDrum
from drumsqueal.physics.bodies.elastic_shoe import ElasticShoe
from drumsqueal.physics.bodies.rigid_shoe import RigidShoe
from drumsqueal.physics.composition import coordinates_of
from drumsqueal.physics.model import body_of
from drumsqueal.progress import Progress
from drumsqueal.questions.export.signals import (
    CENTRE_OF_GRAVITY,
    LEADING_END,
    LONGEST_SHORT,
    MIDDLE,
    OF_NEXT_SHOE,
    TRAILING_END,
    Channel,
    Channels,
    distinct,
)
from drumsqueal.solve.linear.modes import Mode

# Of the points of the shoe, those that a line joins.
OUTLINE = (LEADING_END, MIDDLE, TRAILING_END, CENTRE_OF_GRAVITY, LEADING_END)
POINTS, OUTER = sorted(set(OUTLINE)), (LEADING_END, MIDDLE, TRAILING_END)
SECTIONS, FIRST_OF_GRID = 17, 101  # of a shoe that bends: frames along it, and the number of their first point
AROUND, FIRST_OF_DRUM = 72, 1001  # of a drum that bends: points on each of two circles, and the number of the first
_ID_LINE, _LABEL = 80, 20  # columns
_MODES_A_LINE = 3  # of 24 columns and a separator
# Coordinate systems, all with the drum's axis as their z axis: the model's own, r, θ, z for what the lining does, and
# those of shoes that are turned against the model's, from 3 on.
_GLOBAL, _DRUM = 1, 2
_CARTESIAN, _CYLINDRICAL = 0, 1
_COLOUR = 1
_COMPLEX_MODE, _TRANSLATIONS = 3, 2  # type of the analysis, and of the data at nodes


def write_uff58(channels: Channels, path: Path, progress: Progress) -> str:
    """Write geometry, modes and every signal in ASCII, signals in double precision. Raises OSError."""
    file = pyuff.UFF(str(path))
    mode = "overwrite"
    try:
        for done, dataset in enumerate(_datasets(channels)):
            progress("writing data sets", done, None)
            file.write_sets(dataset, mode)
            mode = "add"
    except Exception as error:  # pyuff hides what the disk says in an exception of its own
        if isinstance(error.__context__, OSError):
            raise error.__context__ from None
        raise
    interval = 1 / channels.sample_rate
    # 1e-9 of the interval between samples: so far six digits of a time may be off without a word
    rounded = [
        f"the {name}, {value:.10g} s"
        for name, value in (("interval", interval), ("start", channels.start))
        if abs(float(f"{value:.5e}") - value) > 1e-9 * interval
    ]
    if not rounded:
        return ""
    return f"Dataset 58 keeps six digits of {', and of '.join(rounded)}; ID line 3 of each states sample rate and start"


def _datasets(channels: Channels) -> Iterator[dict[str, Any]]:
    parts = placed(body_of(channels.scene, coordinates_of(channels.scene)))
    bends = [shoe.elastic is not None for shoe in channels.scene.shoes]
    drawn = [_geometry(part, bends=each) for part, each in zip(parts, bends, strict=True)]
    drum = parts[0].shoe.drum if isinstance(parts[0].shoe, ElasticShoe) else None
    round_drum, circles = ({}, []) if drum is None else _drum_geometry(float(parts[0].shoe.outer_radius), drum)
    points = {number: place for each, _ in drawn for number, place in each.items()}
    lines = [line for _, each in drawn for line in each] + circles
    yield _header(channels)
    yield _units()
    yield _coordinate_systems(parts)
    yield _nodes(points | round_drum, parts)
    for number, (name, line) in enumerate(lines, start=1):
        yield pyuff.prepare_82(trace_num=number, color=_COLOUR, id=name, nodes=np.array(line))
    if channels.stability is not None:
        x, y, z = np.array(list(round_drum.values())).reshape(-1, 3).T
        for number, mode in enumerate(channels.stability.modes):
            q = mode.shape(channels.stability.coordinates)
            found = [
                (part.displaced(q, *np.array(list(own.values())).T), len(own))
                for part, (own, _) in zip(parts, drawn, strict=True)
            ]
            found.append((parts[0].of_drum(q, np.arctan2(y, x), z), len(round_drum)))
            moves = [
                np.concatenate([np.broadcast_to(moved[k], count) for moved, count in found]).astype(complex)
                for k in range(3)
            ]
            yield _mode(channels, mode, number, [*points, *round_drum], moves)
    names = distinct([channel.short_name for channel in channels.channels], LONGEST_SHORT)
    for number, (channel, name) in enumerate(zip(channels.channels, names, strict=True), start=1):
        yield _function(channels, channel, number, name)


def _geometry(part: Placed, *, bends: bool) -> tuple[dict[int, tuple[float, ...]], list[tuple[str, tuple[int, ...]]]]:
    """Places (m) of the points of a shoe by their numbers, and the lines that join them, by name.

    Those that signals belong to, and of a shoe that bends a grid over its surface: a frame around each section. Of
    several shoes each has numbers and names of its own, and is turned to its place.
    """
    points, lines = _geometry_of_one(part.shoe, bends=bends)
    first, prefix = part.share.number * OF_NEXT_SHOE, f"{part.name}: " * bool(part.name)
    places = {first + number: (*turned(x, y, part.position), z) for number, (x, y, z) in points.items()}
    return places, [(f"{prefix}{name}", tuple(first + number for number in line)) for name, line in lines]


def _geometry_of_one(
    shoe: RigidShoe, *, bends: bool
) -> tuple[dict[int, tuple[float, float, float]], list[tuple[str, tuple[int, ...]]]]:
    """The same of a shoe alone."""
    angles, radius = float(shoe.half_angle) * np.array([0.0, -1.0, 1.0]), float(shoe.outer_radius)
    lining = (tuple(radius * np.array([np.cos(angle), np.sin(angle), 0.0])) for angle in angles)
    # In the order of POINTS: (c, 0, 0), then R (cos θ, sin θ, 0) at θ = 0, −β/2 and β/2.
    points: dict[int, Any] = dict(zip(POINTS, [(float(shoe.centroid), 0.0, 0.0), *lining], strict=True))
    lines: list[tuple[str, tuple[int, ...]]] = [("shoe", OUTLINE)]
    if not bends:
        return points, lines
    half, inner = float(shoe.width) / 2, radius - float(shoe.thickness)
    frame = [(radius, -half), (radius, 0.0), (radius, half), (inner, half), (inner, 0.0), (inner, -half)]
    sections = np.linspace(-1.0, 1.0, SECTIONS) * float(shoe.half_angle)
    numbers = FIRST_OF_GRID + np.arange(SECTIONS * len(frame)).reshape(SECTIONS, len(frame))
    for row, angle in zip(numbers.tolist(), sections, strict=True):
        points |= {k: (r * np.cos(angle), r * np.sin(angle), z) for k, (r, z) in zip(row, frame, strict=True)}
        lines.append((f"section at {np.rad2deg(angle):.4g} deg", (*row, row[0])))
    return points, lines + [(f"along the shoe {k}", tuple(line)) for k, line in enumerate(numbers.T.tolist(), start=1)]


def _drum_geometry(
    radius: float, drum: ElasticDrum
) -> tuple[dict[int, tuple[float, ...]], list[tuple[str, tuple[int, ...]]]]:
    """Points of the drum's inner surface, and the circles along its two edges that join them."""
    angles = 2 * np.pi * np.arange(AROUND) / AROUND
    points, lines = {}, []
    for k, z in enumerate((float(drum.offset - drum.width / 2), float(drum.offset + drum.width / 2))):
        numbers = range(FIRST_OF_DRUM + k * AROUND, FIRST_OF_DRUM + (k + 1) * AROUND)
        places = np.stack([radius * np.cos(angles), radius * np.sin(angles), np.full(AROUND, z)], axis=1)
        points |= dict(zip(numbers, map(tuple, places.tolist()), strict=True))
        lines.append((f"drum at z = {1e3 * z:.4g} mm", (*numbers, numbers[0])))
    return points, lines


def _header(channels: Channels) -> dict[str, Any]:
    """Dataset 151; pyuff adds date and time."""
    return pyuff.prepare_151(
        model_name=_fitted(channels.texts["title"], _ID_LINE),
        description=_fitted(f"{channels.texts['source']}; {channels.texts['outcome']}", _ID_LINE),
        db_app=_fitted(channels.texts["versions"], _ID_LINE),
        program="drumsqueal",
    )


def _units() -> dict[str, Any]:
    """Dataset 164. Dividing by its factors gives SI, so for SI they are 1; temperatures do not occur."""
    return pyuff.prepare_164(
        units_code=SI_SYSTEM,
        units_description="SI: metre, newton".ljust(_LABEL),
        temp_mode=1,
        length=1.0,
        force=1.0,
        temp=1.0,
        temp_offset=273.15,
    )


def _own_systems(parts: Sequence[Placed]) -> dict[int, int]:
    """The coordinate system of the axes of each shoe, along which its coordinates are, by the shoe's number."""
    further = itertools.count(_DRUM + 1)
    return {part.share.number: next(further) if part.position else _GLOBAL for part in parts}


def _axes(angle: float) -> NDArray[np.float64]:
    """A row for each axis of a system that is turned by an angle (rad)."""
    axes = np.eye(3)
    axes[:, :2] = np.transpose(turned(axes[:, 0], axes[:, 1], angle))
    return axes


def _coordinate_systems(parts: Sequence[Placed]) -> dict[str, Any]:
    """Dataset 2420: a row for each axis, and the origin, on the drum's axis in the middle of the width."""
    systems = {
        _GLOBAL: (_CARTESIAN, "x through the middle of the lining, y as the drum passes at positive speed", 0.0),
        _DRUM: (_CYLINDRICAL, "r, theta, z about the drum axis", 0.0),
    }
    if parts[0].name:
        systems[_GLOBAL] = _CARTESIAN, "x where shoes have position 0, y as the drum passes at positive speed", 0.0
    for part, label in zip(parts, _own_systems(parts).values(), strict=True):
        if label != _GLOBAL:
            name = _fitted(f"{part.name}: x through the middle of its lining", _ID_LINE)
            systems[label] = _CARTESIAN, name, part.position
    types, names, angles = zip(*systems.values(), strict=True)
    return pyuff.prepare_2420(
        Part_UID=1,
        Part_Name="shoe",
        CS_sys_labels=list(systems),
        CS_types=list(types),
        CS_colors=[_COLOUR] * len(systems),
        CS_names=list(names),
        CS_matrices=[np.vstack([_axes(angle), np.zeros(3)]) for angle in angles],
    )


def _nodes(points: dict[int, tuple[float, ...]], parts: Sequence[Placed]) -> dict[str, Any]:
    """Dataset 2411: places along the model's axes; the lining's directions are radial, along the drum, axial.

    Those of a shoe's centre of gravity are along its own axes.
    """
    x, y, z = np.array(list(points.values())).T
    systems = {part.share.number * OF_NEXT_SHOE + point: _DRUM for part in parts for point in OUTER}
    systems |= {number * OF_NEXT_SHOE + CENTRE_OF_GRAVITY: each for number, each in _own_systems(parts).items()}
    return pyuff.prepare_2411(
        node_nums=np.array(list(points)),
        def_cs=np.full(len(points), _GLOBAL),
        disp_cs=np.array([systems.get(point, _GLOBAL) for point in points]),
        color=np.full(len(points), _COLOUR),
        x=x,
        y=y,
        z=z,
    )


def _mode(
    channels: Channels, mode: Mode, number: int, points: list[int], moves: list[NDArray[np.complex128]]
) -> dict[str, Any]:
    """Dataset 55 of the mode of that number (from 0 on): translations of the points along the global axes.

    Modal A and B are 0, which is none: with friction they take the left eigenvector, for which there is no place.
    """
    x, y, z = moves
    place = f"mode {mode.name}" if is_elastic(mode.name) else f"{mode.name} at the centre of gravity"
    return pyuff.prepare_55(
        id1=_fitted(f"mode {channels.prediction[number]}", _ID_LINE),
        id2=_fitted(channels.texts["title"], _ID_LINE),
        id3="complex mode of steady sliding, along the global x, y, z at every node",
        id4=f"in m where {place} is 1 {unit_of(mode.name)}",
        id5="NONE",
        model_type=1,
        analysis_type=_COMPLEX_MODE,
        data_ch=_TRANSLATIONS,
        spec_data_type=type_of("displacement"),
        load_case=0,
        mode_n=number + 1,
        eig=mode.eigenvalue,
        node_nums=points,
        r1=x,
        r2=y,
        r3=z,
    )


def _function(channels: Channels, channel: Channel, number: int, name: str) -> dict[str, Any]:
    """Dataset 58 of one signal; `number` is its version number, which distinguishes functions at one point.

    `name` is what the response is called, in as many columns as there are.
    """
    rate = f"sample rate {channels.sample_rate!r} Hz from {channels.start:.12g} s; {channels.texts['source']}"
    modes = ["; ".join(channels.prediction[k : k + _MODES_A_LINE]) for k in (0, _MODES_A_LINE)]
    # Exponents count where the type is general, and for what has no direction; elsewhere the type says all.
    length, force = (0, 0) if channel.direction else channel.length_force
    return pyuff.prepare_58(
        binary=0,
        id1=_fitted(f"{channel.name}: {channel.meaning}", _ID_LINE),
        id2=_fitted(f"{channels.texts['title']}; {channels.texts['outcome']}", _ID_LINE),
        id3=_fitted(rate, _ID_LINE),
        id4=_fitted(modes[0], _ID_LINE),
        id5=_fitted(modes[1], _ID_LINE),
        func_type=TIME_RESPONSE,
        ver_num=number,
        load_case_id=0,
        rsp_ent_name=name.ljust(LONGEST_SHORT),
        rsp_node=channel.point,
        rsp_dir=channel.direction,
        ref_ent_name="NONE".ljust(LONGEST_SHORT),
        ref_node=0,
        ref_dir=0,
        abscissa_spacing=1,  # even
        z_axis_value=0.0,
        abscissa_spec_data_type=TIME_AXIS,
        abscissa_axis_units_lab="s",
        ordinate_spec_data_type=type_of(channel.quantity),
        ordinate_len_unit_exp=length,
        ordinate_force_unit_exp=force,
        ordinate_axis_units_lab=_fitted(channel.units, _LABEL),
        orddenom_spec_data_type=0,
        z_axis_spec_data_type=0,
        data=channel.values,
        x=channels.time,
    ) | {"abscissa_axis_lab": "time", "ordinate_axis_lab": _fitted(name, _LABEL)}


def _fitted(text: str, columns: int) -> str:
    """Text in ASCII, for columns are counted in bytes, in so many of them; NONE for none, as the format asks."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    return "".join(letter if letter.isprintable() else " " for letter in plain)[:columns].strip() or "NONE"
