"""Coordinate reference systems as text: their names, their units, and the keys of GeoTIFF.

A cloud holds the system of its file as one text: WKT; `EPSG:n` or `EPSG:n+m` (horizontal and
vertical); or, where GeoTIFF keys say more than such codes, `GeoTIFF` and the keys as a JSON object.
Nothing is transformed by it.
"""

from __future__ import annotations

import json
import math
import re
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from surfabet._core import PointCloud
from surfabet.io._units import name_of

_KEYS = "GeoTIFF"
_MODEL, _PROJECTED, _GEOGRAPHIC, _VERTICAL = 1024, 3072, 2048, 4096
_PROJECTED_UNIT, _VERTICAL_UNIT, _ANGULAR_UNIT = 3076, 4099, 2054
_CITATIONS = (3073, 1026, 2049)
# What a code of a system implies, or what only describes it.
_IMPLIED = {_MODEL, 1025, *_CITATIONS, 4097}
_UNITS = {9001: ("metre", 1.0), 9002: ("foot", 0.3048), 9003: ("US survey foot", 1200 / 3937)}
_DEGREE = ("degree", math.nan)
# In this range EPSG has its geographic systems, and GeoTIFF no others.
_GEOGRAPHIC_CODES = range(4000, 5000)
_CODES = range(1, 32767)
_DOUBLES, _TEXTS = 34736, 34737
_MOST_KEYS = 500

Unit = tuple[str, float]
Keys = dict[int, int | float | str]


@dataclass
class _Node:
    """`KEYWORD[texts and numbers, nodes]` of WKT."""

    keyword: str
    values: list[str] = field(default_factory=list)
    children: list[_Node] = field(default_factory=list)

    def walk(self) -> Iterator[_Node]:
        left = [self]
        while left:
            node = left.pop()
            yield node
            left.extend(reversed(node.children))


_TOKEN = re.compile(r'"((?:[^"]|"")*)"|([A-Za-z_][A-Za-z0-9_]*)|([-+0-9.][-+0-9.eE]*)|([\[\](),])')


def _parse(wkt: str) -> _Node:
    """The tree of a WKT text; what does not parse is passed over."""
    root = _Node("")
    open_nodes = [root]
    word: str | None = None
    for text, name, number, mark in _TOKEN.findall(wkt):
        if mark in ("[", "(") and mark:
            node = _Node((word or "").upper())
            open_nodes[-1].children.append(node)
            open_nodes.append(node)
            word = None
            continue
        if mark and word is not None:
            open_nodes[-1].values.append(word)
            word = None
        if mark in ("]", ")") and mark and len(open_nodes) > 1:
            open_nodes.pop()
        elif name:
            word = name
        elif number:
            open_nodes[-1].values.append(number)
        elif not mark:
            open_nodes[-1].values.append(text.replace('""', '"'))
    return root


_LINEAR_SYSTEMS = ("PROJCS", "PROJCRS", "PROJECTEDCRS", "LOCAL_CS", "ENGCRS", "GEOCCS")
_ANGULAR_SYSTEMS = ("GEOGCS", "GEOGCRS", "GEODCRS", "GEODETICCRS", "GEOGRAPHICCRS")
_COMPOUND_SYSTEMS = ("COMPD_CS", "COMPOUNDCRS")
_VERTICAL_SYSTEMS = ("VERT_CS", "VERTCRS", "VERTICALCRS")
_SYSTEMS = (*_LINEAR_SYSTEMS, *_ANGULAR_SYSTEMS, *_COMPOUND_SYSTEMS)


def _first(tree: _Node, keywords: tuple[str, ...]) -> _Node | None:
    return next((node for node in tree.walk() if node.keyword in keywords), None)


def _unit_of(system: _Node, keywords: tuple[str, ...]) -> Unit | None:
    """The unit that stands in a system itself, or else in its axes."""
    axes = [child for axis in system.children if axis.keyword == "AXIS" for child in axis.children]
    for node in [*system.children, *axes]:
        if node.keyword in keywords and len(node.values) >= 2:
            try:
                return node.values[0], float(node.values[1])
            except ValueError:
                continue
    return None


def _wkt_units(wkt: str) -> tuple[Unit | None, Unit | None]:
    tree = _parse(wkt)
    horizontal: Unit | None = None
    system = _first(tree, _LINEAR_SYSTEMS) or _first(tree, _ANGULAR_SYSTEMS)
    if system is not None:
        horizontal = _unit_of(system, ("UNIT", "LENGTHUNIT"))
        if system.keyword in _ANGULAR_SYSTEMS and not _unit_of(system, ("LENGTHUNIT",)):
            horizontal = _DEGREE
    system = _first(tree, _VERTICAL_SYSTEMS)
    return horizontal, None if system is None else _unit_of(system, ("UNIT", "LENGTHUNIT"))


def _cited_unit(keys: Keys) -> Unit | None:
    """The unit that the name of a projected system ends in, as those of EPSG do: (ftUS), (ft)."""
    for key in _CITATIONS:
        if found := re.search(r"\((ftUS|ft)\)", str(keys.get(key, ""))):
            return _UNITS[9003 if found[1] == "ftUS" else 9002]
    return None


def _key_units(keys: Keys) -> tuple[Unit | None, Unit | None]:
    code = keys.get(_PROJECTED_UNIT)
    horizontal = _UNITS.get(code) if isinstance(code, int) else _cited_unit(keys)
    if keys.get(_MODEL) == 2 or (_GEOGRAPHIC in keys and _PROJECTED not in keys):
        horizontal = _DEGREE
    code = keys.get(_VERTICAL_UNIT)
    return horizontal, _UNITS.get(code) if isinstance(code, int) else None


def crs_units(crs: str) -> tuple[Unit | None, Unit | None]:
    """Horizontal and vertical unit, each with its length in metres (NaN for angles), where known.

    Without a vertical unit heights are in the horizontal one.
    """
    keys = geotiff_keys(crs)
    if keys is None:
        horizontal, vertical = _wkt_units(crs)
    else:
        horizontal, vertical = _key_units(keys)
    if vertical is None and horizontal is not None and not math.isnan(horizontal[1]):
        vertical = horizontal
    return horizontal, vertical


def _unit_text(unit: Unit | None) -> str:
    if unit is None:
        return "an unknown unit"
    name, length = unit
    return name if length == 1 or math.isnan(length) else f"{name} ({length:.10g} m)"


def unit_remark(crs: str) -> str | None:
    """What to say of a system whose units are not the metre in both directions."""
    units = crs_units(crs)
    if all(unit is None or unit[1] == 1 for unit in units):
        return None
    horizontal, vertical = map(_unit_text, units)
    return (
        f"coordinates are kept in the units of their reference system ({crs_name(crs)}): "
        f"{horizontal} horizontally, {vertical} vertically"
    )


def unit_name(crs: str) -> str:
    """The horizontal unit of a system, as `read(unit=)` has it; `m` where it is not known."""
    unit = crs_units(crs)[0]
    if unit is None:
        return "m"
    name, metres = unit
    return name_of(metres) or name


def unit_of(cloud: PointCloud) -> str:
    """The unit of a cloud's lengths, which is that of its file's coordinate reference system."""
    return "m" if cloud.crs is None else unit_name(cloud.crs)


def crs_name(crs: str) -> str:
    """A short name of a coordinate reference system."""
    if crs.startswith(_KEYS):
        keys = geotiff_keys(crs) or {}
        named = (keys[key] for key in _CITATIONS if isinstance(keys.get(key), str))
        return str(next(named, "GeoTIFF keys")).strip()[:120]
    if geotiff_keys(crs) is not None:
        return crs
    system = _first(_parse(crs), _SYSTEMS)
    return (system.values[0] if system is not None and system.values else crs.strip())[:120]


def _codes(crs: str) -> tuple[int, int | None] | None:
    """Horizontal and vertical code of `EPSG:n` and `EPSG:n+m`."""
    found = re.fullmatch(r"EPSG:(\d{1,6})(?:\+(\d{1,6}))?", crs.strip(), re.IGNORECASE)
    if found is None:
        return None
    return int(found[1]), None if found[2] is None else int(found[2])


def _is_key(key: int, value: object) -> bool:
    shorts = range(1 << 16)
    return key in shorts and (isinstance(value, (float, str)) or value in shorts)


def geotiff_keys(crs: str) -> Keys | None:
    """The GeoTIFF keys of a system given by codes or by keys; `None` for WKT."""
    if crs.startswith(_KEYS):
        try:
            given = {int(key): value for key, value in json.loads(crs[len(_KEYS) :]).items()}
        except (ValueError, AttributeError):
            return None
        return given if all(map(_is_key, given, given.values())) else None
    if (codes := _codes(crs)) is None:
        return None
    horizontal, vertical = codes
    if horizontal not in _CODES or (vertical is not None and vertical not in _CODES):
        return None
    geographic = horizontal in _GEOGRAPHIC_CODES
    keys: Keys = {_MODEL: 2 if geographic else 1, 1025: 1}
    keys[_GEOGRAPHIC if geographic else _PROJECTED] = horizontal
    if vertical is not None:
        keys[_VERTICAL] = vertical
    return keys


def crs_of_keys(keys: Keys) -> str | None:
    """The text for GeoTIFF keys: codes where these say it all, else the keys themselves."""
    if not keys.keys() - _IMPLIED:
        # Only a name, which says nothing of the system.
        return f"{_KEYS} {json.dumps(keys)}" if keys.keys() & {*_CITATIONS} else None
    rest = keys.keys() - _IMPLIED - {_PROJECTED, _GEOGRAPHIC, _VERTICAL}
    in_metres = all(keys[key] == 9001 for key in rest & {_PROJECTED_UNIT, _VERTICAL_UNIT})
    in_metres &= keys.get(_ANGULAR_UNIT, 9102) == 9102
    horizontal = keys.get(_PROJECTED, keys.get(_GEOGRAPHIC))
    vertical = keys.get(_VERTICAL)
    known = horizontal in _CODES and (vertical is None or vertical in _CODES)
    is_projected = _PROJECTED in keys
    if (
        known
        and in_metres
        and _cited_unit(keys) is None
        and not rest - {_PROJECTED_UNIT, _VERTICAL_UNIT, _ANGULAR_UNIT}
        and is_projected != (horizontal in _GEOGRAPHIC_CODES)
    ):
        return f"EPSG:{horizontal}" + (f"+{vertical}" if vertical is not None else "")
    return f"{_KEYS} {json.dumps(keys)}"


def parse_directory(directory: bytes, doubles: bytes, texts: bytes) -> Keys:
    """The keys of a GeoTIFF directory; those that point outside of its data are passed over."""
    keys: Keys = {}
    n_keys = struct.unpack_from("<H", directory, 6)[0] if len(directory) >= 8 else 0
    for number in range(min(n_keys, (len(directory) - 8) // 8, _MOST_KEYS)):
        key, place, count, value = struct.unpack_from("<4H", directory, 8 + 8 * number)
        if place == 0:
            keys[key] = value
        elif place == _DOUBLES and 8 * value + 8 <= len(doubles) and count == 1:
            (number_,) = struct.unpack_from("<d", doubles, 8 * value)
            if math.isfinite(number_):
                keys[key] = number_
        elif place == _TEXTS and value + count <= len(texts):
            text = texts[value : value + count].decode("latin-1")
            keys[key] = text.rstrip("\0").removesuffix("|").rstrip("\0")
    return keys


def directory_of(keys: Mapping[int, int | float | str]) -> tuple[bytes, bytes, bytes]:
    """Directory, doubles and texts for GeoTIFF keys, as `parse_directory` reads them."""
    entries, doubles, texts = [], b"", b""
    for key, value in sorted(keys.items()):
        if isinstance(value, str):
            text = value.encode("latin-1", "replace") + b"|"
            entries.append(struct.pack("<4H", key, _TEXTS, len(text), len(texts)))
            texts += text
        elif isinstance(value, float):
            entries.append(struct.pack("<4H", key, _DOUBLES, 1, len(doubles) // 8))
            doubles += struct.pack("<d", value)
        else:
            entries.append(struct.pack("<4H", key, 0, 1, value))
    return struct.pack("<4H", 1, 1, 0, len(entries)) + b"".join(entries), doubles, texts
