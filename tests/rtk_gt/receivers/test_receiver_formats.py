"""Files of receivers of every kind: the same fixes, told by their content, compressed or not."""

import bz2
import gzip
import struct
import zipfile
import zlib

import numpy as np
import pytest

from rtk_gt.exports.points import Points
from rtk_gt.exports.texts import gpx
from rtk_gt.receivers.baselines import on_base
from rtk_gt.receivers.fixes import AUTONOMOUS, DGPS, RTK_FIXED, RTK_FLOAT
from rtk_gt.receivers.formats.fix_csv import read_fix_csv
from rtk_gt.receivers.formats.nmea import read_nmea
from rtk_gt.receivers.formats.novatel import crc
from rtk_gt.receivers.formats.reading import Stated, form_of, read_baselines, read_receiver
from rtk_gt.receivers.utm import geodetic_of_utm
from validation.errors import GtvalError, InputError
from validation.poses.earth_frames import LocalFrame

START = 1_712_739_600.0
"""2024-04-10 09:00:00 UTC, which is 18 s earlier than the same in GPS time."""
DEGREES = [45.478, 9.232, 160.0]
WEEK, SECONDS = 2309, 291_618.0
"""The same instant in GPS time: 2309 weeks after 1980-01-06, Wednesday 09:00:18."""


def sentence(body):
    value = 0
    for character in body:
        value ^= ord(character)
    return f"${body}*{value:02X}"


def gga(clock="090000.00", kind=4, talker="GN", height="112.000", minutes="28.6800000"):
    return sentence(
        f"{talker}GGA,{clock},45{minutes},N,00913.9200000,E,{kind},12,0.9,{height},M,48.0,M,1.0,0000"
    )


RMC = sentence("GNRMC,090000.00,A,4528.68,N,00913.92,E,0.1,0.0,100424,,,R")


def written(folder, name, content):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def read(path, **more):
    return read_receiver(path, Stated("roof", **more))


def assert_first(found, kind=RTK_FIXED):
    """That a record's first fix is the one of this module."""
    assert found.times[0] == pytest.approx(START, abs=1e-6)
    np.testing.assert_allclose(np.degrees(found.geodetic[0, :2]), DEGREES[:2], atol=1e-9)
    assert found.geodetic[0, 2] == pytest.approx(DEGREES[2], abs=1e-6)
    assert found.kinds[0] == kind


# NMEA


def test_a_second_gga_of_one_time_is_left_out_and_counted(tmp_path):
    """Receivers write GP and GN of each epoch: the first one's talker is taken."""
    lines = [RMC]
    for k in range(4):
        pair = [gga(f"09000{k}.00"), gga(f"09000{k}.00", talker="GP", height="111.000")]
        lines += pair if k % 2 == 0 else pair[::-1]
    found = read(written(tmp_path, "roof.nmea", "\n".join(lines)))
    assert_first(found)
    assert len(found) == 4
    assert (found.geodetic[:, 2] == 160.0).all()
    assert found.tolerated["another GGA of the same time left out"] == 4


def test_sentences_out_of_order_are_sorted_and_counted(tmp_path):
    clocks = ["00.00", "00.40", "00.20", "00.60"]
    lines = [RMC, *(gga(f"0900{clock}") for clock in clocks)]
    found = read(written(tmp_path, "roof.nmea", "\n".join(lines)))
    np.testing.assert_allclose(np.diff(found.times), 0.2, atol=1e-6)
    assert found.lines.tolist() == [2, 4, 3, 5]
    assert found.tolerated["sentences out of order, sorted"] == 1


def test_a_gga_with_an_empty_altitude_is_left_out_and_counted(tmp_path):
    lines = [RMC, gga(), gga("090001.00", height=""), gga("090002.00")]
    found = read(written(tmp_path, "roof.nmea", "\n".join(lines)))
    assert len(found) == 2
    assert found.epochs == 3
    assert found.tolerated["GGA with an empty altitude left out"] == 1
    with pytest.raises(InputError, match="no altitude"):
        read(written(tmp_path, "flat.nmea", "\n".join([RMC, gga(height="")])))


def test_few_damaged_lines_are_left_out_many_are_an_error(tmp_path):
    good = [RMC, *(gga(f"0900{k:02d}.00") for k in range(60))]
    cut = [*good[:20], good[20][:30], *good[21:40], good[40].replace("28.68", "28.67"), *good[41:]]
    found = read(written(tmp_path, "roof.nmea", "\n".join(cut)))
    assert len(found) == 58
    assert sum(n for what, n in found.tolerated.items() if what.startswith("damaged")) == 2
    assert any("2 damaged sentences were left out" in note for note in found.notes)
    bad = [line[:30] if k % 10 == 0 else line for k, line in enumerate(good)]
    with pytest.raises(InputError, match="line 11") as raised:
        read(written(tmp_path, "bad.nmea", "\n".join(bad)))
    assert "skip_damaged" in str(raised.value)
    with pytest.raises(InputError, match="line 21"):
        read_nmea(tmp_path / "roof.nmea", "roof", skip_damaged=False)


# compressed


@pytest.mark.parametrize("kind", ["gz", "bz2", "zip"])
def test_compressed_logs_are_read_and_damaged_ones_named(tmp_path, kind):
    text = f"{RMC}\n{gga()}".encode()
    path = tmp_path / f"roof.nmea.{kind}"
    if kind == "zip":
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("inside/roof.nmea", text)
    else:
        path.write_bytes({"gz": gzip.compress, "bz2": bz2.compress}[kind](text))
    assert_first(read(path))
    path.write_bytes(path.read_bytes()[:-14])
    with pytest.raises(InputError, match="cut or damaged"):
        read(path)


def test_an_archive_of_two_logs_is_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "two.zip", "w") as archive:
        archive.writestr("a.nmea", gga())
        archive.writestr("b.nmea", gga())
    with pytest.raises(InputError, match=r"2 files \(a.nmea, b.nmea\)"):
        read(tmp_path / "two.zip")


# u-blox


def frame(number, payload, kind=1):
    body = bytes([kind, number]) + struct.pack("<H", len(payload)) + payload
    a = b = 0
    for byte in body:
        a = (a + byte) & 255
        b = (b + a) & 255
    return b"\xb5\x62" + body + bytes([a, b])


def pvt(tow=1000, second=0, nano=0, carrier=2, fix=3):
    """NAV-PVT by the interface description of u-blox: 92 bytes."""
    flags = 1 | 2 | carrier << 6
    head = struct.pack(
        "<IHBBBBBBIiBBBB", tow, 2024, 4, 10, 9, 0, second, 0x7, 20, nano, fix, flags, 0, 12
    )
    place = struct.pack("<iiiiII", 92_320_000, 454_780_000, 160_000, 112_000, 14, 20)
    rest = struct.pack("<iiiiiIIHHIihH", 0, 0, 0, 0, 0, 0, 0, 150, 0, 0, 0, 0, 0)
    return frame(0x07, head + place + rest)


def high(tow=1000):
    return frame(
        0x14,
        struct.pack(
            "<BHBIiiiibbbbII", 0, 0, 0, tow, 92_320_000, 454_780_000, 160_000, 112_000,
            12, -7, 3, 0, 141, 203,
        ),
    )  # fmt: skip


def dop(tow=1000):
    return frame(0x04, struct.pack("<I7H", tow, 190, 150, 100, 120, 85, 60, 60))


def test_a_u_blox_log_gives_kinds_errors_and_hdop(tmp_path):
    log = pvt() + dop() + pvt(2000, 1, carrier=1) + pvt(3000, 2, carrier=0) + pvt(4000, 3, fix=0)
    found = read(written(tmp_path, "roof.ubx", log))
    assert_first(found)
    assert found.kinds.tolist() == [RTK_FIXED, RTK_FLOAT, DGPS]
    assert found.without_fix == 1
    assert found.satellites[0] == 12
    assert found.hdop[0] == 0.85
    # 14 mm level is of two directions together, 20 mm upwards.
    np.testing.assert_allclose(
        np.sqrt(np.diagonal(found.covariances[0])), [0.014 / 2**0.5, 0.014 / 2**0.5, 0.020]
    )


def test_high_precision_positions_are_taken_and_noise_between_messages_is_not(tmp_path):
    """NAV-HPPOSLLH adds 1e-9 degrees and tenths of a millimetre."""
    log = b"$GNTXT,hello*00\r\n" + pvt()[:-1] + pvt(nano=-3_000_000) + high() + b"\xb5\x62\x01"
    found = read(written(tmp_path, "roof.log", log))
    assert found.times[0] == pytest.approx(START - 0.003, abs=1e-4)
    np.testing.assert_allclose(
        np.degrees(found.geodetic[0, :2]), [45.478 - 7e-9, 9.232 + 12e-9], atol=1e-12
    )
    assert found.geodetic[0, 2] == pytest.approx(160.0003)
    assert found.covariances[0, 2, 2] == pytest.approx(0.0203**2)
    assert found.tolerated == {"damaged message skipped (checksum)": 1}
    with pytest.raises(InputError, match="NAV-PVT"):
        read(written(tmp_path, "none.ubx", dop()))


# RTKLIB and Emlid


ROW = "{day} {clock}   45.478000000    9.232000000   160.0000   1  12   0.0100   0.0110   0.0200   "
ROW += "0.0010  -0.0020   0.0010   1.00   15.0"


def test_a_file_of_emlid_has_rows_without_a_header(tmp_path):
    rows = [ROW.format(day="2024/04/10", clock=f"09:00:{18 + k}.000") for k in range(3)]
    found = read(written(tmp_path, "reach_raw.LLH", "\n".join(rows)))
    assert_first(found)
    assert found.covariances[0, 1, 1] == pytest.approx(1e-4)
    assert any("GPS time" in note for note in found.notes)
    pos = "%  GPST  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)\n" + rows[0]
    assert_first(read(written(tmp_path, "roof.pos", pos)))


def test_baselines_in_a_pos_file_need_a_base(tmp_path):
    head = "%  GPST  e-baseline(m)  n-baseline(m)  u-baseline(m)   Q  ns  sde(m)\n"
    row = "2024/04/10 09:00:18.000 1.5 0.2 0.1 1 12 0.003 0.004 0.006 0 0 0 1.0 15.0\n"
    path = written(tmp_path, "rover.pos", head + row)
    with pytest.raises(InputError, match="state `base`"):
        read(path)
    base = read(written(tmp_path, "base.nmea", f"{RMC}\n{gga()}"))
    found = on_base(read_baselines(path, Stated("rover")), base, 0.05)
    frame_at_base = LocalFrame.from_degrees(*DEGREES)
    np.testing.assert_allclose(
        frame_at_base.from_geodetic(found.geodetic), [[1.5, 0.2, 0.1]], atol=1e-6
    )
    assert found.kinds.tolist() == [RTK_FIXED]
    late = on_base(read_baselines(path, Stated("rover")), base.select(np.array([0])), 0.05)
    assert len(late) == 1


def test_a_rover_without_its_base_in_time_is_named(tmp_path):
    base = read(written(tmp_path, "base.nmea", f"{RMC}\n{gga()}"))
    table = f"time,east,north,height,fix\n{START + 60},1.5,0.2,0.1,fixed\n"
    path = written(tmp_path, "rover.csv", table)
    with pytest.raises(InputError, match="no time in common with its base roof"):
        on_base(read_baselines(path, Stated("rover")), base, 0.05)


def test_a_u_blox_rover_tells_its_way_from_the_base(tmp_path):
    payload = struct.pack(
        "<BBHIiiiiiIbbbbIIIIIII", 1, 0, 0, 1000, 20, 150, -10, 152, 0, 0, 5, 0, -5, 0,
        40, 30, 60, 40, 0, 0, 1 | 2 | 4 | 2 << 3 | 1 << 5,
    )  # fmt: skip
    base = read(written(tmp_path, "base.ubx", pvt()))
    rover = read_baselines(
        written(tmp_path, "rover.ubx", pvt() + frame(0x3C, payload)), Stated("rover")
    )
    np.testing.assert_allclose(rover.east_north_up, [[1.5, 0.2005, 0.1005]])
    both = on_base(rover, base, 0.05)
    own = np.diagonal(both.covariances[0]) - np.diagonal(base.covariances[0])
    np.testing.assert_allclose(own, [9e-6, 16e-6, 36e-6], atol=1e-12)


# NovAtel


MANUAL = (
    "BESTPOSA,COM1,0,83.5,FINESTEERING,1419,336148.000,02000040,6145,2724;SOL_COMPUTED,SINGLE,"
    "51.11636418888,-114.03832502118,1064.9520,-16.2712,WGS84,1.6961,1.3636,3.6449,"
    '"",0.000,0.000,8,8,8,8,0,0,0,06'
)


def bestpos(seconds=SECONDS, kind="NARROW_INT", status="SOL_COMPUTED"):
    body = (
        f"BESTPOSA,COM1,0,83.5,FINESTEERING,{WEEK},{seconds:.3f},02000040,6145,2724;{status},{kind},"
        "45.478000000,9.232000000,112.0000,48.0000,WGS84,0.0100,0.0110,0.0200,"
        '"AAAA",1.000,0.000,14,12,12,12,0,01,0,03'
    )
    return f"#{body}*{crc(body):08x}"


def test_a_novatel_log_is_read(tmp_path):
    other = "#RXSTATUSA,COM1,0,83.5,FINESTEERING,1419,336148.000,0,0,0;0*00000000"
    lines = [other, bestpos(), bestpos(SECONDS + 1, "NARROW_FLOAT"), bestpos(SECONDS + 2, "NONE")]
    found = read(written(tmp_path, "roof.asc", "\n".join(lines)))
    assert_first(found)
    assert found.kinds.tolist() == [RTK_FIXED, RTK_FLOAT]
    assert found.without_fix == 1
    assert found.satellites.tolist() == [12, 12]
    np.testing.assert_allclose(np.sqrt(np.diagonal(found.covariances[0])), [0.011, 0.01, 0.02])


def test_the_crc_of_novatel_is_that_of_its_manual():
    """A bytewise form of the polynomial 0xEDB88320 that starts at zero and is not inverted."""
    value = 0
    for byte in MANUAL.encode():
        value ^= byte
        for _ in range(8):
            value = (value >> 1) ^ (0xEDB88320 if value & 1 else 0)
    assert crc(MANUAL) == value
    assert crc(MANUAL) != zlib.crc32(MANUAL.encode())


def test_damaged_lines_of_novatel_are_errors_where_many(tmp_path):
    lines = [bestpos(SECONDS + k) for k in range(30)]
    lines[7] = lines[7].replace("45.478", "45.479")
    found = read(written(tmp_path, "roof.asc", "\n".join(lines)))
    assert len(found) == 29
    assert sum(found.tolerated.values()) == 1
    with pytest.raises(InputError, match="line 2"):
        read(written(tmp_path, "bad.asc", "\n".join([lines[0], lines[7]])))
    with pytest.raises(InputError, match="position type"):
        read(written(tmp_path, "new.asc", bestpos(kind="QUANTUM_INT")))


# GPX


def points(kinds):
    n = len(kinds)
    return Points(
        "court", START + np.arange(n), np.tile(DEGREES, (n, 1)), tuple(kinds), ("",) * n,
        np.full(n, 12.0), np.full(n, 0.9), np.full(n, 0.01), np.full(n, 0.02),
    )  # fmt: skip


def test_a_gpx_file_of_gtval_comes_back(tmp_path):
    path = written(tmp_path, "court.gpx", gpx(points(["RTK fixed", "RTK float"]), 2.0))
    found = read(path)
    assert_first(found)
    assert found.kinds.tolist() == [RTK_FIXED, RTK_FLOAT]
    assert found.hdop.tolist() == [0.9, 0.9]
    assert found.covariances[0, 2, 2] == pytest.approx(0.02**2)
    assert not found.notes


def test_a_gpx_file_of_others_does_not_tell_what_is_fixed(tmp_path):
    text = (
        '<?xml version="1.0"?><gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1"><trk>'
        '<trkseg><trkpt lat="45.478" lon="9.232"><ele>160</ele><time>2024-04-10T09:00:00Z</time>'
        "<fix>3d</fix></trkpt></trkseg></trk></gpx>"
    )
    path = written(tmp_path, "court.gpx", text)
    found = read(path)
    assert_first(found, AUTONOMOUS)
    assert any("all_fixed" in note for note in found.notes)
    assert_first(read(path, all_fixed=True))
    with pytest.raises(InputError, match="line 1, field 'lat'"):
        read(written(tmp_path, "bad.gpx", text.replace("45.478", "95.478")))
    with pytest.raises(InputError, match="not whole XML"):
        read(written(tmp_path, "cut.gpx", text[:200]))


# bags


def test_navsatfix_and_sentences_of_a_bag_are_read(tmp_path):
    rosbag2, typesys = (
        pytest.importorskip("rosbags.rosbag2"),
        pytest.importorskip("rosbags.typesys"),
    )
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    store.register(
        typesys.get_types_from_msg(
            "std_msgs/Header header\nstring sentence", "nmea_msgs/msg/Sentence"
        )
    )
    types = store.types
    kind = "sensor_msgs/msg/NavSatFix"
    with rosbag2.Writer(
        tmp_path / "bag", version=9, storage_plugin=rosbag2.StoragePlugin.MCAP
    ) as writer:
        fix = writer.add_connection("/fix", kind, typestore=store)
        text = writer.add_connection("/nmea", "nmea_msgs/msg/Sentence", typestore=store)
        for k, (status, sigma) in enumerate(((2, 0.01), (2, 0.4), (-1, 1.0), (0, 3.0))):
            stamp = types["builtin_interfaces/msg/Time"](sec=int(START) + k, nanosec=0)
            header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="gps")
            message = types[kind](
                header, types["sensor_msgs/msg/NavSatStatus"](status=status, service=1), *DEGREES,
                np.diag([sigma**2] * 3).ravel(), 2,
            )  # fmt: skip
            now = (int(START) + k) * 10**9
            writer.write(fix, now, store.serialize_cdr(message, kind))
            line = types["nmea_msgs/msg/Sentence"](
                header, RMC if k == 0 else gga(f"09000{k - 1}.00")
            )
            writer.write(text, now, store.serialize_cdr(line, "nmea_msgs/msg/Sentence"))
    mcap = next((tmp_path / "bag").glob("*.mcap"))
    found = read(mcap, label="/fix")
    assert_first(found)
    assert found.kinds.tolist() == [RTK_FIXED, RTK_FLOAT, AUTONOMOUS]
    assert found.without_fix == 1
    assert found.covariances[0, 0, 0] == pytest.approx(1e-4)
    assert any("does not tell RTK fixed" in note for note in found.notes)
    assert_first(read(tmp_path / "bag", label="nmea"))
    with pytest.raises(InputError, match="several topics with positions"):
        read(mcap)


# tables


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("time,latitude,longitude,height,fix", f"{START},45.478,9.232,160,4"),
        ("timestamp,lat,lon,ellipsoidal_height,quality", f"{START},45.478,9.232,160,4"),
        ("Time;Latitude (deg);Longitude (deg);Height [m];Q", f"{START};45.478;9.232;160;1"),
        ("utc,lat_deg,lng,alt,geoid_separation,status", f"{START},45.478,9.232,112,48,FIX"),
        ("date,time,lat,lon,h,fix_type", "2024-04-10,09:00:00,45.478,9.232,160,RTK_FIXED"),
        ("stamp,lat,lon,hae,solution", f"{int(START)}000,45.478,9.232,160,narrow_int"),
        ("timestamp,lat,lon,hae,fix", f"{int(START)}000000000,45.478,9.232,160,fixed"),
        ("time\tlatitude\tlongitude\theight (ft)\tfix", f"{START}\t45.478\t9.232\t524.934383\tfixed"),  # noqa: E501
    ],
)  # fmt: skip
def test_common_names_of_columns_are_known(tmp_path, header, row):
    found = read(written(tmp_path, "roof.csv", f"{header}\n{row}\n"))
    assert_first(found)


def test_numbers_that_makers_give_kinds_are_not_taken_for_those_of_gga(tmp_path):
    text = f"time,lat,lon,h,fix_type\n{START},45.478,9.232,160,6\n"
    with pytest.raises(InputError, match="makers number kinds") as raised:
        read_fix_csv(written(tmp_path, "roof.csv", text), "roof")
    assert "line 2" in str(raised.value)
    with pytest.raises(InputError, match="radians"):
        read(written(tmp_path, "rad.csv", f"time,lat (rad),lon,h\n{START},0.79,9.2,160\n"))


def test_utm_coordinates_are_those_of_an_independent_library(tmp_path):
    pyproj = pytest.importorskip("pyproj")
    generator = np.random.default_rng(0)
    for zone, code, south in (("32N", 32632, 1), ("32S", 32732, -1)):
        there = pyproj.Transformer.from_crs(4326, code, always_xy=True)
        longitude, latitude = generator.uniform(6, 12, 50), south * generator.uniform(0, 83, 50)
        east, north = there.transform(longitude, latitude)
        found = np.degrees(geodetic_of_utm(np.column_stack([east, north]), zone))
        # 1e-12 degrees are a tenth of a micrometre.
        np.testing.assert_allclose(found, np.column_stack([latitude, longitude]), atol=1e-12)
    east, north = pyproj.Transformer.from_crs(4326, 32632, always_xy=True).transform(9.232, 45.478)
    table = f"time,easting,northing,height,fix\n{START},{east},{north},160,fixed\n"
    path = written(tmp_path, "roof.csv", table)
    assert_first(read(path, coordinates="utm", zone="32N"))
    with pytest.raises(InputError, match="no UTM zone"):
        read(path, coordinates="utm", zone="32T")
    with pytest.raises(GtvalError, match="not in a UTM zone"):
        geodetic_of_utm(np.array([[5_000_000.0, 500_000.0]]), "32N")


def test_local_coordinates_need_the_place_of_their_origin(tmp_path):
    path = written(tmp_path, "roof.csv", f"time,x,y,z,fix\n{START},0,0,0,fixed\n")
    origin = LocalFrame.from_degrees(*DEGREES)
    assert_first(read(path, coordinates="local", frame=origin))
    with pytest.raises(InputError, match=r"state \[rtk.origin\]"):
        read(path, coordinates="local")


@pytest.mark.parametrize(
    ("name", "head", "form"),
    [
        ("a.txt", gga(), "nmea"),
        ("a.log", "time,latitude,longitude,height\n", "csv"),
        ("a.csv", f"1220287568.12, {gga()}", "nmea"),
        ("a.dat", "% program : RTKLIB\n", "rtklib"),
        ("a.dat", "what is this", None),
        ("a.gpx.gz", "<?xml", "gpx"),
    ],
)
def test_kinds_are_told_by_content_then_by_name(tmp_path, name, head, form):
    assert form_of(tmp_path / name, head.encode()) == form


def test_a_file_of_no_kind_says_what_to_do(tmp_path):
    with pytest.raises(InputError, match="set format to one of"):
        read(written(tmp_path, "roof.dat", "what is this"))
    with pytest.raises(InputError, match="empty"):
        read(written(tmp_path, "roof.nmea", "\n\n"))
