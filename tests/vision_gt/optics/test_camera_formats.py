"""Camera files as other programs write them: where their cameras see points, OpenCV's must, too."""

import io
from pathlib import Path

import cv2
import numpy as np
import pytest

from validation.errors import InputError
from vision_gt.optics.camera import project
from vision_gt.optics.camera_files import FORMATS, camera_of, read_cameras

K = np.array([[612.5, 0, 321.2], [0, 613.7, 238.9], [0, 0, 1.0]])
BROWN = [-0.28, 0.075, 0.0006, -0.0004, 0.01]
RADTAN = [-0.28, 0.075, 0.0006, -0.0004]
RATIONAL = [-0.1, 0.05, 0.0003, -0.0002, 0.01, 0.15, 0.02, 0.005]
WIDE = [0.01, -0.02, 0.005, -0.001]
"""Of cv2.fisheye."""
NONE = [0.0] * 5

SIZE = "image_width: 640\nimage_height: 480\n"
ORB = "%YAML:1.0\nCamera.width: 640\nCamera.height: 480\nCamera.fps: 30.0\n"
FOCAL = "{0}fx: 612.5\n{0}fy: 613.7\n{0}cx: 321.2\n{0}cy: 238.9\n"
TANGENTIAL = "{0}k1: -0.28\n{0}k2: 0.075\n{0}p1: 0.0006\n{0}p2: -0.0004\n"
KB = "{0}k1: 0.01\n{0}k2: -0.02\n{0}k3: 0.005\n{0}k4: -0.001\n"
STREAM = (
    '{"width": 640, "height": 480, "fx": 612.5, "fy": 613.7, "ppx": 321.2, "ppy": 238.9, '
    '"model": %s, "coeffs": %s}'
)
BASALT = (
    '{"value0": {"T_imu_cam": [], "resolution": [[640, 480]], "intrinsics": [{"camera_type": "%s", '
    '"intrinsics": {"fx": 612.5, "fy": 613.7, "cx": 321.2, "cy": 238.9%s}}]}}'
)
OST = """# oST version 5.0 parameters


[image]

width
640

height
480

[narrow_stereo]

camera matrix
612.500000 0.000000 321.200000
0.000000 613.700000 238.900000
0.000000 0.000000 1.000000

distortion
-0.28 0.075 0.0006 -0.0004 0.01

rectification
1.000000 0.000000 0.000000
0.000000 1.000000 0.000000
0.000000 0.000000 1.000000

projection
592.5 0.000000 321.2 0.000000
0.000000 593.7 238.9 0.000000
0.000000 0.000000 1.000000 0.000000
"""
XML = """<?xml version="1.0"?>
<opencv_storage>
<image_Width>640</image_Width>
<image_Height>480</image_Height>
<Camera_Matrix type_id="opencv-matrix">
  <rows>3</rows><cols>3</cols><dt>d</dt>
  <data>612.5 0. 321.2 0. 613.7 238.9 0. 0. 1.</data></Camera_Matrix>
<Distortion_Coefficients type_id="opencv-matrix">
  <rows>5</rows><cols>1</cols><dt>d</dt>
  <data>-0.28 0.075 0.0006 -0.0004 0.01</data></Distortion_Coefficients>
</opencv_storage>
"""
MESSAGE = """header:
  stamp: {sec: %d, nanosec: 2}
  frame_id: head
height: 480
width: 640
distortion_model: plumb_bob
d: [-0.28, 0.075, 0.0006, -0.0004, 0.01]
k: [612.5, 0.0, 321.2, 0.0, 613.7, 238.9, 0.0, 0.0, 1.0]
roi: {x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false}
---
"""
CAMODOCAL = (
    SIZE
    + "model_type: KANNALA_BRANDT\nprojection_parameters:\n"
    + (
        "  k2: 0.01\n  k3: -0.02\n  k4: 0.005\n  k5: -0.001\n"
        "  mu: 612.5\n  mv: 613.7\n  u0: 321.2\n  v0: 238.9\n"
    )
)
RADTAN8 = (
    ', "k1": -0.1, "k2": 0.05, "p1": 0.0003, "p2": -0.0002, "k3": 0.01, "k4": 0.15, "k5": 0.02, '
    '"k6": 0.005, "rpmax": 2.7'
)
KB4 = ', "k1": 0.01, "k2": -0.02, "k3": 0.005, "k4": -0.001'

WRITTEN = {
    "orb_slam2.yaml": (ORB + FOCAL.format("Camera.") + TANGENTIAL.format("Camera."), RADTAN),
    "orb_slam2_k3.yaml": (
        ORB + FOCAL.format("Camera.") + TANGENTIAL.format("Camera.") + "Camera.k3: 0.01\n",
        BROWN,
    ),
    "orb_slam3.yaml": (
        'File.version: "1.0"\nCamera.type: "PinHole"\nCamera.newWidth: 320\n'
        + ORB.removeprefix("%YAML:1.0\n")
        + FOCAL.format("Camera1.")
        + TANGENTIAL.format("Camera1."),
        RADTAN,
    ),
    "orb_slam3_wide.yaml": (
        ORB + 'Camera.type: "KannalaBrandt8"\n' + FOCAL.format("Camera1.") + KB.format("Camera1."),
        WIDE,
    ),
    "orb_slam3_rectified.yaml": (
        ORB + 'Camera.type: "Rectified"\n' + FOCAL.format("Camera1."),
        NONE,
    ),
    "realsense.json": (STREAM % ('"distortion.brown_conrady"', BROWN), BROWN),
    "realsense_words.json": (STREAM % ('"Brown Conrady"', BROWN), BROWN),
    "realsense_number.json": (STREAM % (4, BROWN), BROWN),
    "realsense_wide.json": (STREAM % ('"Kannala Brandt4"', [*WIDE, 0.0]), WIDE),
    "realsense_without.json": (STREAM % ('"Inverse Brown Conrady"', NONE), NONE),
    "realsense_radial.json": (
        STREAM % ('"Modified Brown Conrady"', [-0.28, 0.075, 0, 0, 0.01]),
        [-0.28, 0.075, 0, 0, 0.01],
    ),
    "realsense_stream.json": ('{"color":\t' + STREAM % ('"Brown Conrady"', BROWN) + "}", BROWN),
    "basalt.json": (BASALT % ("pinhole", ""), NONE),
    "basalt_radtan8.json": (BASALT % ("pinhole-radtan8", RADTAN8), RATIONAL),
    "basalt_kb4.json": (BASALT % ("kb4", KB4), WIDE),
    "camodocal.yaml": (CAMODOCAL, WIDE),
    "samples.xml": (XML, BROWN),
    "mtx_dist.json": (
        f'{{"mtx": {K.tolist()}, "dist": [{BROWN}], "image_size": [640, 480]}}',
        BROWN,
    ),
    "ost.txt": (OST, BROWN),
    "camera.ini": (OST.replace("\n\n", "\n").replace("width\n640", "width 640"), BROWN),
    "topic.yaml": (MESSAGE % 1, BROWN),
    "topics.yaml": (MESSAGE % 1 + MESSAGE % 2, BROWN),
    "uncalibrated_lens.yaml": (
        SIZE + f"distortion_model: ''\nK: {K.ravel().tolist()}\nD: []\n",
        NONE,
    ),
}


def seen_by_opencv(lens, matrix=K, *, fisheye=None):
    """Points up to 30 degrees off the axis, and where OpenCV sees them."""
    side = np.tan(np.linspace(-0.5, 0.5, 9))
    points = np.stack(np.meshgrid(side, 0.8 * side, [1.0]), axis=-1).reshape(-1, 1, 3)
    zero = np.zeros(3)
    fisheye = lens is WIDE if fisheye is None else fisheye
    see = cv2.fisheye.projectPoints if fisheye else cv2.projectPoints
    args = (zero, zero, matrix, np.array(lens))
    return points[:, 0], see(points, *args)[0][:, 0]


@pytest.mark.parametrize("name", WRITTEN)
def test_a_file_is_read_as_the_camera_that_opencv_has_with_its_numbers(tmp_path, name):
    text, lens = WRITTEN[name]
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    (camera,) = read_cameras(path)
    assert camera.size == (640, 480)
    points, pixels = seen_by_opencv(lens)
    # Both compute with doubles; nothing is rounded but their last digits.
    np.testing.assert_allclose(project(points, camera.parameters), pixels, atol=1e-9)


COLMAP = {
    "SIMPLE_PINHOLE": ("612.5 321.7 239.4", NONE),
    "PINHOLE": ("612.5 613.7 321.7 239.4", NONE),
    "SIMPLE_RADIAL": ("612.5 321.7 239.4 -0.28", [-0.28, 0, 0, 0]),
    "RADIAL": ("612.5 321.7 239.4 -0.28 0.075", [-0.28, 0.075, 0, 0]),
    "OPENCV": ("612.5 613.7 321.7 239.4 -0.28 0.075 0.0006 -4e-4", RADTAN),
    "FULL_OPENCV": (
        "612.5 613.7 321.7 239.4 -0.1 0.05 0.0003 -0.0002 0.01 0.15 0.02 0.005",
        RATIONAL,
    ),
    "SIMPLE_FISHEYE": ("612.5 321.7 239.4", [0.0] * 4),
    "FISHEYE": ("612.5 613.7 321.7 239.4", [0.0] * 4),
    "SIMPLE_RADIAL_FISHEYE": ("612.5 321.7 239.4 0.01", [0.01, 0, 0, 0]),
    "RADIAL_FISHEYE": ("612.5 321.7 239.4 0.01 -0.02", [0.01, -0.02, 0, 0]),
    "OPENCV_FISHEYE": ("612.5 613.7 321.7 239.4 0.01 -0.02 0.005 -0.001", WIDE),
}


@pytest.mark.parametrize("model", COLMAP)
def test_cameras_of_colmap_have_their_pixel_centres_moved(tmp_path, model):
    """The centre of the top-left pixel is (0.5, 0.5) there: all pixels have half a pixel more."""
    values, lens = COLMAP[model]
    path = tmp_path / "cameras.txt"
    path.write_text(
        "# Camera list with one line of data per camera:\n"
        f"#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n7 {model} 640 480 {values}\n"
        "8 FOV 640 480 612.5 613.7 321.7 239.4 0.9\n"
    )
    camera = camera_of(path, "7")
    matrix = K + np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])
    if "SIMPLE" in model or "RADIAL" in model:
        matrix[1, 1] = matrix[0, 0]
    points, pixels = seen_by_opencv(lens, matrix, fisheye="FISHEYE" in model)
    np.testing.assert_allclose(project(points, camera.parameters) + 0.5, pixels, atol=1e-9)
    with pytest.raises(InputError, match=r"line 4, field 'MODEL': 'FOV'"):
        read_cameras(path)


@pytest.mark.parametrize("names", [("mtx", "dist"), ("camera_matrix", "dist_coeffs")])
def test_arrays_of_numpy_are_read_and_its_points_left_out(tmp_path, names):
    path = tmp_path / "calibration.npz"
    fields = {names[0]: K, names[1]: np.array([BROWN]), "objpoints": np.zeros((20, 54, 3))}
    np.savez_compressed(path, image_width=640, image_height=480, **fields)
    (camera,) = read_cameras(path)
    points, pixels = seen_by_opencv(BROWN)
    np.testing.assert_allclose(project(points, camera.parameters), pixels, atol=1e-9)
    np.savez(path, **fields)
    with pytest.raises(InputError, match=r"'image_width': the camera file lacks this; add it"):
        read_cameras(path)


def npz(**fields):
    stream = io.BytesIO()
    np.savez(stream, **fields)
    return stream.getvalue()


@pytest.mark.parametrize(
    ("name", "data", "said"),
    [
        ("objects.npz", npz(mtx=np.array([None])), "objects, which are not read"),
        ("cut.npz", npz(mtx=K)[:-30], "no archive as numpy"),
        ("spoilt.npz", npz(mtx=K)[:99] + b"?" + npz(mtx=K)[100:], "not a camera file of numpy"),
        ("one.npy", b"\x93NUMPY", "numpy.savez"),
        ("cameras.bin", b"\x01\x00", "model_converter --output_type TXT"),
        ("wrong.m", b"MATLAB 5.0 MAT-file", r"name it \.mat"),
    ],
)
def test_binary_files_are_named_for_what_they_are(tmp_path, name, data, said):
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(InputError, match=said):
        read_cameras(path)


def stereo(matrix):
    return ORB + FOCAL.format("Camera.") + f"LEFT.K: !!opencv-matrix\n{matrix}"


MATRIX = "   rows: 3\n   cols: 3\n   dt: d\n   data: [1., 0., 1., 0., 1., 1., 0., 0., 1.]\n"
PIXELS = f"K: {K.ravel().tolist()}\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (STREAM % ('"distortion.inverse_brown_conrady"', BROWN), "Brown's lens backwards"),
        (STREAM % (1, BROWN), "tangential part after the radial"),
        (STREAM % ('"F-Theta"', [0.9, 0, 0, 0, 0]), "field-of-view"),
        (STREAM % ('"None"', BROWN), "no lens, and yet"),
        (STREAM % ('"Fisheye"', BROWN), "expected a lens of RealSense"),
        (BASALT % ("ds", ', "xi": -0.2, "alpha": 0.6'), "double-sphere"),
        (BASALT % ("eucm", ', "alpha": 0.6, "beta": 1.1'), "extended unified"),
        (BASALT % ("ucm", ', "alpha": 0.6'), "the unified camera"),
        (BASALT % ("fov", ', "w": 0.9'), "field-of-view"),
        (BASALT % ("linear", ""), "expected pinhole, pinhole-radtan8 or kb4"),
        (stereo(MATRIX), "Camera.fx is of rectified images"),
        (ORB + "Camera.type: Equirectangular\n" + FOCAL.format("Camera1."), "expected PinHole"),
        (ORB + "Camera.model: fisheye\n" + FOCAL.format("Camera."), "stella_vslam"),
        (ORB + FOCAL.format("Camera.") + KB.format("Camera."), "no k4"),
        (
            ORB + FOCAL.format("Camera.") + "Camera.k1: 0.1\n",
            r"'Camera\.k2': the camera file lacks",
        ),
        (
            ORB
            + "Camera.type: Rectified\n"
            + FOCAL.format("Camera1.")
            + TANGENTIAL.format("Camera1."),
            "yet with distortion",
        ),
        (OST.replace("0.0006 -0.0004 0.01", "0.0006 -0.0004"), "four numbers may be"),
        (OST + OST, "two cameras"),
        (OST.replace("distortion\n", "lens\n"), "'distortion_coefficients'.*lacks this"),
        (MESSAGE % 1 + (MESSAGE % 2).replace("612.5", "612.6"), "2 documents, which differ"),
        ((MESSAGE % 1).replace("width: 0", "width: 400"), "a part of the sensor"),
        ((MESSAGE % 1).replace("plumb_bob", "''"), "it names no lens"),
        (
            SIZE
            + "distortion_model: plumb_bob\nK: [0, 0, 0, 0, 0, 0, 0, 0, 0]\nD: [0, 0, 0, 0, 0]",
            "nobody calibrated",
        ),
        (SIZE + f"camera_matrix: {K.T.tolist()}\ndist: {BROWN}\n", "transposed"),
        (
            SIZE + f"K: {{rows: 3, cols: 4, data: {K.ravel().tolist()}}}\nD: {BROWN}\n",
            "3 rows and 4",
        ),
        (f"image_size: [480, 640]\n{PIXELS}D: {BROWN}\n", "seem to be exchanged"),
        (f"image_width: 640.5\nimage_height: 480\n{PIXELS}D: {BROWN}\n", "positive whole number"),
        ("speed: 3\n", "of no other format that is read: .*Kalibr.*RealSense"),
    ],
)
def test_what_cannot_be_read_is_named(tmp_path, text, said):
    path = tmp_path / "camera.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said):
        read_cameras(path)


def test_of_two_cameras_the_named_one_is_read(tmp_path):
    path = tmp_path / "stereo.yaml"
    path.write_text(
        ORB + FOCAL.format("Camera1.") + FOCAL.format("Camera2.").replace("612.5", "600.0")
    )
    assert [one.name for one in read_cameras(path)] == ["Camera1", "Camera2"]
    assert camera_of(path, "Camera2").parameters[0] == 600
    path.write_text('{"left": %s, "right": %s}' % ((STREAM % (0, NONE),) * 2))
    assert [one.name for one in read_cameras(path)] == ["left", "right"]


def test_a_camera_that_is_sold_under_the_name_of_a_lens_model_is_read(tmp_path):
    path = tmp_path / "sold.yaml"
    path.write_text(SIZE + f"{PIXELS}D: {BROWN}\ncamera_model: DS-2CD2143\n")
    assert read_cameras(path)[0].parameters[4:].tolist() == BROWN


def test_the_formats_that_are_read_are_told():
    told = (Path(__file__).parents[3] / "docs" / "vision.md").read_text(encoding="utf-8")
    rows = [line for line in told.splitlines() if line.startswith("| ")]
    for one in FORMATS:
        assert not one.name or any(row.startswith(f"| {one.name} |") for row in rows), one.name
