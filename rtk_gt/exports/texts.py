"""Points as GeoJSON, GPX, KML and CSV.

Sources: RFC 7946 (GeoJSON), the GPX 1.1 schema of Topografix, and OGC KML 2.2. GeoJSON has heights
above the ellipsoid, as ours are. GPX and KML mean heights above the sea, which only a model of the
geoid would give: in GPX they are those above the ellipsoid, as its description says, and in KML the
points lie on the ground and tell their height.
"""

import json
from collections.abc import Iterator
from datetime import UTC, datetime
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from rtk_gt.exports.points import Points
from validation.text_files.csv_text import csv_text

FORMATS = (".geojson", ".gpx", ".kml", ".csv")
_HEIGHTS = "Heights are metres above the WGS84 ellipsoid, times UTC, sigmas one standard deviation."
_COLOURS = {"RTK fixed": "ff73a000", "RTK float": "ff009ee6"}
"""KML's aabbggrr of kinds of fixes; the others are grey. Fixed and float also differ in size."""
_GREY = "ff555555"


def export_text(points: Points, suffix: str, longest_gap: float) -> str:
    """The text of a file.

    Parameters
    ----------
    points : Points
        At least one.
    suffix : str
        One of `FORMATS`.
    longest_gap : float
        Seconds; no line of GPX leads over longer pauses.
    """
    if suffix == ".gpx":
        return gpx(points, longest_gap)
    return {".geojson": geojson, ".kml": kml, ".csv": table}[suffix](points)


def moment(time: float) -> str:
    """ISO 8601 in UTC, to the millisecond."""
    stamp = datetime.fromtimestamp(round(time, 3), tz=UTC)
    return stamp.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _rows(points: Points) -> Iterator[tuple[str, float, float, float, dict[str, str | float]]]:
    """Time, latitude, longitude, height and what is told of the quality, of each point."""
    columns = {
        "satellites": points.satellites,
        "hdop": points.hdop,
        "sigma_level": points.level_sigma,
        "sigma_up": points.up_sigma,
    }
    for row, (latitude, longitude, height) in enumerate(points.geodetic.tolist()):
        told: dict[str, str | float] = {"fix": points.kinds[row]}
        if points.remarks[row]:
            told["remark"] = points.remarks[row]
        for name, values in columns.items():
            if np.isfinite(values[row]):
                value = float(values[row])
                told[name] = int(value) if name == "satellites" else round(value, 4)
        yield moment(points.times[row]), latitude, longitude, height, told


def geojson(points: Points) -> str:
    """A feature for each point, one a line."""
    features = [
        json.dumps({
            "type": "Feature",
            "geometry": {
                "type": "Point",
                "coordinates": [round(longitude, 9), round(latitude, 9), round(height, 4)],
            },
            "properties": {"time": time, **told},
        })
        for time, latitude, longitude, height, told in _rows(points)
    ]  # fmt: skip
    head = json.dumps({"name": points.name, "description": _HEIGHTS})[1:-1]
    inside = ",\n".join(features)
    return f'{{"type": "FeatureCollection", {head}, "features": [\n{inside}\n]}}\n'


def gpx(points: Points, longest_gap: float) -> str:
    """One track, with a segment for each stretch without a gap."""
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<gpx version="1.1" creator="gtval" xmlns="http://www.topografix.com/GPX/1/1">',
        f"<metadata><name>{escape(points.name)}</name><desc>{_HEIGHTS}</desc></metadata>",
        f"<trk><name>{escape(points.name)}</name><trkseg>",
    ]
    pauses = np.diff(points.times, prepend=points.times[0]) > longest_gap
    for pause, (time, latitude, longitude, height, told) in zip(pauses, _rows(points), strict=True):
        if pause:
            lines.append("</trkseg><trkseg>")
        sigmas = [f"{name} {told[name]} m" for name in ("sigma_level", "sigma_up") if name in told]
        remark = [str(told["remark"])] if "remark" in told else []
        comment = "; ".join([str(told["fix"]), *remark, *sigmas])
        # In the order of the schema. Its kinds of fixes know no RTK: that is in cmt.
        inside = f"<ele>{height:.4f}</ele><time>{time}</time><cmt>{escape(comment)}</cmt>"
        inside += f"<sat>{told['satellites']}</sat>" if "satellites" in told else ""
        inside += f"<hdop>{told['hdop']}</hdop>" if "hdop" in told else ""
        lines.append(f'<trkpt lat="{latitude:.9f}" lon="{_east(longitude):.9f}">{inside}</trkpt>')
    return "\n".join([*lines, "</trkseg></trk></gpx>"]) + "\n"


def _east(longitude: float) -> float:
    """Longitude from -180 to below 180, as GPX has it."""
    return (longitude + 180.0) % 360.0 - 180.0


def kml(points: Points) -> str:
    """A placemark for each point, in a folder for each kind of fix."""
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<kml xmlns="http://www.opengis.net/kml/2.2"><Document>',
        f"<name>{escape(points.name)}</name><description>{_HEIGHTS}</description>",
    ]
    rows = list(_rows(points))
    for kind in sorted(set(points.kinds)):
        colour = next((c for name, c in _COLOURS.items() if kind.startswith(name)), _GREY)
        scale = 0.4 if kind.startswith("RTK fixed") else 0.25
        look = f"<color>{colour}</color><scale>{scale}</scale>"
        style = quoteattr(kind.replace(" ", "_"))
        lines += [
            f"<Style id={style}><IconStyle>{look}</IconStyle></Style>",
            f"<Folder><name>{escape(kind)}</name>",
        ]
        for time, latitude, longitude, height, told in rows:
            if told["fix"] != kind:
                continue
            data = "".join(
                f'<Data name="{name}"><value>{escape(str(value))}</value></Data>'
                for name, value in {**told, "height": round(height, 4)}.items()
            )
            lines.append(
                f"<Placemark><TimeStamp><when>{time}</when></TimeStamp>"
                f"<styleUrl>#{style[1:-1]}</styleUrl><ExtendedData>{data}</ExtendedData>"
                f"<Point><coordinates>{_east(longitude):.9f},{latitude:.9f}</coordinates></Point>"
                "</Placemark>"
            )
        lines.append("</Folder>")
    return "\n".join([*lines, "</Document></kml>"]) + "\n"


def table(points: Points) -> str:
    """A row for each point; the fix columns are those that `[[rtk.receivers]]` reads."""
    names = ("fix", "satellites", "hdop", "sigma_level", "sigma_up", "remark")
    header = ("time", "latitude", "longitude", "height", *names)
    rows = (
        (time, latitude, longitude, round(height, 4), *(told.get(name, "") for name in names))
        for time, latitude, longitude, height, told in _rows(points)
    )
    return csv_text(header, rows)
