"""A picture of each package, made from its imports: run `make images` after a change.

Boxes are the rooms of a package (folders, and the modules beside them). An arrow leads from a
room to one that imports it, so that data flow from left to right; arrows that follow from others
are left out. Imports inside functions and those for type checkers count as well.
"""

import ast
from collections.abc import Iterable, Mapping
from functools import cache
from itertools import pairwise
from pathlib import Path
from xml.sax.saxutils import escape

DOCS = Path(__file__).parent
ROOT = DOCS.parent
PACKAGES = ("gtval", "validation", "survey", "laser_gt", "vision_gt", "rtk_gt", "data_samples")

Arrows = Mapping[str, set[str]]
"""What each room imports."""

LETTER, BOX_HEIGHT, ROW, COLUMN_GAP, MARGIN = 7.6, 30, 44, 44, 16
"""Pixels: width of a letter, height of a box, distance of rows, gap between columns, border."""


def modules(package: str) -> dict[str, Path]:
    """Every module of a package, by its dotted name."""
    found = {}
    for path in sorted((ROOT / package).rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imports(name: str, path: Path, known: Iterable[str]) -> set[str]:
    """Modules of our own that a module imports, wherever in its text.

    Raises
    ------
    ValueError
        For a relative import: the house has none.
    """
    known = set(known)
    # What is named may be a module or something inside one.
    found = {inner if (inner := f"{of}.{what}") in known else of for of, what in _imported(path)}
    return {one for one in found if one in known and one != name}


@cache
def _imported(path: Path) -> frozenset[tuple[str, str]]:
    """Modules that a file imports, each with what of it; '' for the whole."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {(alias.name, "") for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            if node.level or node.module is None:
                raise ValueError(f"{path} has a relative import")
            found |= {(node.module, alias.name) for alias in node.names}
    return frozenset(found)


def arrows(folder: str, own: Mapping[str, Path] | None = None) -> dict[str, set[str]]:
    """What each room of a folder imports of its other rooms.

    Parameters
    ----------
    folder : str
        Dotted name of a package or of a room that has rooms itself.
    own : mapping of str to Path, optional
        Modules of its package, where they are known.
    """
    own = own or modules(folder.partition(".")[0])
    depth = folder.count(".") + 1

    def room(name: str) -> str | None:
        parts = name.split(".")
        inside = len(parts) > depth and name.startswith(f"{folder}.")
        return parts[depth] if inside and parts[depth] != "__main__" else None

    found: dict[str, set[str]] = {}
    for name, path in own.items():
        here = room(name)
        if here is None:
            continue
        there = {room(one) for one in imports(name, path, own)}
        found.setdefault(here, set()).update(one for one in there if one not in {None, here})
    return found


def circles(graph: Arrows) -> list[tuple[str, ...]]:
    """Groups of rooms that import each other, by whatever way around."""
    reached = {room: _reached(graph, room) for room in graph}
    groups = {
        tuple(sorted(other for other in reached[room] if room in reached[other]))
        for room in graph
        if room in reached[room]
    }
    return sorted(groups)


def _reached(graph: Arrows, start: str) -> set[str]:
    """What a room imports, and what that imports, and so on."""
    found: set[str] = set()
    open_rooms = [start]
    while open_rooms:
        for room in graph[open_rooms.pop()] - found:
            found.add(room)
            open_rooms.append(room)
    return found


def shortest(graph: Arrows) -> dict[str, set[str]]:
    """The arrows that do not follow from others (transitive reduction of a graph)."""
    return {
        room: {
            one
            for one in there
            if not any(one in _reached(graph, other) for other in there if other != one)
        }
        for room, there in graph.items()
    }


def picture(package: str) -> str:
    """The picture of a package as SVG text, the same for the same imports.

    Raises
    ------
    ValueError
        If rooms import each other in a circle: there is no left and right then.
    """
    graph = arrows(package)
    if circles(graph):
        raise ValueError(f"{package} has circles: {circles(graph)}")
    drawn = shortest({room: there for room, there in graph.items() if _touched(graph, room)})
    columns = _columns(drawn)
    rows = _rows(drawn, columns)
    return _svg(package, drawn, columns, rows)


def _touched(graph: Arrows, room: str) -> bool:
    return bool(graph[room]) or any(room in there for there in graph.values())


def _columns(graph: Arrows) -> dict[str, int]:
    """The column of each room: one to the right of all that it imports."""
    columns: dict[str, int] = {}

    def column(room: str) -> int:
        if room not in columns:
            columns[room] = max((column(one) + 1 for one in graph[room]), default=0)
        return columns[room]

    for room in sorted(graph):
        column(room)
    # A room that nothing to its left holds back stands just before the first that uses it.
    for room in sorted(graph, key=lambda one: -columns[one]):
        users = [columns[one] for one, there in graph.items() if room in there]
        if users:
            columns[room] = min(users) - 1
    return columns


Place = tuple[str, int]
"""A room in its column, or where an arrow from it passes a column further to the right."""


def _ways(graph: Arrows, columns: Mapping[str, int]) -> dict[tuple[str, str], list[Place]]:
    """The places of every arrow, from the imported room to the importing one."""
    return {
        (one, room): [
            *((one, column) for column in range(columns[one], columns[room])),
            (room, columns[room]),
        ]
        for room, there in sorted(graph.items())
        for one in sorted(there)
    }


def _rows(graph: Arrows, columns: Mapping[str, int]) -> dict[Place, float]:
    """The row of each place: near to those that it is joined with, so that few arrows cross."""
    steps = [step for way in _ways(graph, columns).values() for step in pairwise(way)]
    near: dict[Place, set[Place]] = {(room, columns[room]): set() for room in graph}
    for left, right in steps:
        near.setdefault(left, set()).add(right)
        near.setdefault(right, set()).add(left)
    order = [
        sorted(place for place in near if place[1] == column)
        for column in range(max(columns.values()) + 1)
    ]
    tallest = max(len(places) for places in order)
    rows = {
        place: row + (tallest - len(places)) / 2
        for places in order
        for row, place in enumerate(places)
    }
    for sweep in range(24):
        ways = range(len(order)) if sweep % 2 == 0 else range(len(order) - 1, -1, -1)
        for column in ways:
            side = -1 if sweep % 2 == 0 else 1
            order[column].sort(key=lambda place: (_middle(place, near, rows, side), place))
            for row, place in enumerate(order[column]):
                rows[place] = row + (tallest - len(order[column])) / 2
    return rows


def _middle(
    place: Place, near: Mapping[Place, set[Place]], rows: Mapping[Place, float], side: int
) -> float:
    """Mean row of the neighbours on one side; the place's own where it has none."""
    beside = [rows[one] for one in near[place] if one[1] == place[1] + side]
    return sum(beside) / len(beside) if beside else rows[place]


def _svg(
    package: str, graph: Arrows, columns: Mapping[str, int], rows: Mapping[Place, float]
) -> str:
    """Boxes and arrows."""
    widths = [
        max(len(room) for room in graph if columns[room] == column) * LETTER + 24
        for column in range(max(columns.values()) + 1)
    ]
    left = [MARGIN + sum(widths[:column]) + column * COLUMN_GAP for column in range(len(widths))]
    lowest, highest = min(rows.values()), max(rows.values())
    height = MARGIN * 2 + (highest - lowest) * ROW + BOX_HEIGHT
    width = left[-1] + widths[-1] + MARGIN

    def middle(place: Place) -> float:
        return MARGIN + (rows[place] - lowest) * ROW + BOX_HEIGHT / 2

    lines = [
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
            f'width="{width:.0f}" height="{height:.0f}" role="img" font-family="sans-serif" '
            'font-size="13">'
        ),
        f"<title>Rooms of {escape(package)}: an arrow leads to what imports</title>",
        (
            '<defs><marker id="head" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" '
            'markerHeight="7" orient="auto"><path d="M0 0 8 4 0 8z" fill="#5a6b7b"/></marker>'
            "</defs>"
        ),
        f'<rect width="{width:.0f}" height="{height:.0f}" fill="#ffffff"/>',
    ]
    for (one, _), way in _ways(graph, columns).items():
        start = f"M{left[columns[one]] + _width(one):.1f} {middle(way[0]):.1f}"
        curve = [start]
        at = left[columns[one]] + _width(one)
        for place, following in pairwise(way):
            column, y, next_y = following[1], middle(place), middle(following)
            end = left[column] - 2
            bend = (end - at) / 2
            curve.append(
                f"C{at + bend:.1f} {y:.1f} {end - bend:.1f} {next_y:.1f} {end:.1f} {next_y:.1f}"
            )
            at = end
            if following is not way[-1]:
                at = left[column] + widths[column]
                curve.append(f"L{at:.1f} {next_y:.1f}")
        path = " ".join(curve)
        lines.append(
            f'<path d="{path}" fill="none" stroke="#5a6b7b" stroke-width="1.2" '
            'marker-end="url(#head)"/>'
        )
    for room in sorted(graph):
        x, y = left[columns[room]], middle((room, columns[room]))
        folder = (ROOT / package / room).is_dir()
        fill, stroke = ("#e3eef8", "#2f6ca3") if folder else ("#f4f4f4", "#9a9a9a")
        lines.append(
            f'<rect x="{x:.1f}" y="{y - BOX_HEIGHT / 2:.1f}" width="{_width(room):.1f}" '
            f'height="{BOX_HEIGHT}" rx="5" fill="{fill}" stroke="{stroke}"/>'
        )
        lines.append(
            f'<text x="{x + _width(room) / 2:.1f}" y="{y + 4.5:.1f}" text-anchor="middle" '
            f'fill="#1c2733">{escape(room)}</text>'
        )
    return "\n".join([*lines, "</svg>"]) + "\n"


def _width(room: str) -> float:
    return len(room) * LETTER + 24


def main() -> None:
    """Write docs/images/rooms_PACKAGE.svg."""
    for package in PACKAGES:
        path = DOCS / "images" / f"rooms_{package}.svg"
        try:
            path.write_text(picture(package), encoding="utf-8")
        except ValueError as error:
            print(f"not drawn: {error}")  # noqa: T201


if __name__ == "__main__":
    main()
