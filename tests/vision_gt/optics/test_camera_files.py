"""Camera files of four programs, read and written; those of others: test_camera_formats."""

import numpy as np
import pytest
from vision_scenes import LENS, SIZE

from validation.errors import GtvalError, InputError
from vision_gt.optics.camera import Camera
from vision_gt.optics.camera_files import camera_of, read_cameras
from vision_gt.optics.lenses import fisheye_parameters, rational_parameters
from vision_gt.optics.written_cameras import write_camera

SUFFIXES = {"opencv": ".yaml", "ros": ".yaml", "kalibr": ".yaml", "bouguet": ".mat"}


def a_camera(k3: float = 0.0) -> Camera:
    values = LENS.copy()
    values[8] = k3
    return Camera("left", SIZE, values, np.diag(np.arange(1.0, 10.0) ** 2))


@pytest.mark.parametrize("file_format", SUFFIXES)
def test_what_is_written_is_read_back(tmp_path, file_format):
    path = tmp_path / f"left{SUFFIXES[file_format]}"
    camera = a_camera(0.0 if file_format == "kalibr" else -0.015)
    path.write_bytes(write_camera(path.suffix, file_format, camera))
    found = read_cameras(path)[0]
    np.testing.assert_allclose(found.parameters, camera.parameters, rtol=1e-15)
    assert found.size == SIZE
    if file_format in ("opencv", "bouguet"):
        np.testing.assert_allclose(found.covariance, camera.covariance, rtol=1e-12)


def test_opencv_xml(tmp_path):
    path = tmp_path / "left.xml"
    path.write_bytes(write_camera(".xml", "opencv", a_camera()))
    assert path.read_bytes().startswith(b"<?xml")
    np.testing.assert_allclose(read_cameras(path)[0].parameters, LENS, rtol=1e-15)


def test_ros_file_as_its_calibrator_writes_it(tmp_path):
    path = tmp_path / "narrow.yaml"
    path.write_text(
        "image_width: 640\nimage_height: 480\ncamera_name: narrow\n"
        "camera_matrix:\n  rows: 3\n  cols: 3\n  data: [500, 0, 320, 0, 501, 240, 0, 0, 1]\n"
        "distortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n"
        "  data: [-0.1, 0.01, 0.001, 0.002, 0]\n"
    )
    camera = read_cameras(path)[0]
    assert (camera.name, camera.size) == ("narrow", (640, 480))
    np.testing.assert_allclose(camera.parameters, [500, 501, 320, 240, -0.1, 0.01, 0.001, 0.002, 0])


def test_kalibr_chain_with_two_cameras(tmp_path):
    one = (
        "cam{n}:\n  cam_overlaps: []\n  camera_model: pinhole\n"
        "  distortion_coeffs: [-0.3, 0.1, 0.0, 0.0]\n  distortion_model: radtan\n"
        "  intrinsics: [460.0, 459.0, 365.0, 249.0]\n  resolution: [752, 480]\n"
        "  rostopic: /cam{n}/image_raw\n"
    )
    path = tmp_path / "camchain.yaml"
    path.write_text(one.format(n=0) + one.format(n=1))
    assert [camera.name for camera in read_cameras(path)] == ["cam0", "cam1"]


def test_a_camera_of_a_chain_is_read_whatever_lens_another_has(tmp_path):
    path = tmp_path / "camchain.yaml"
    path.write_text(
        "cam0:\n  camera_model: ds\n  distortion_model: none\n  distortion_coeffs: []\n"
        "  intrinsics: [-0.2, 0.6, 500.0, 501.0, 320.0, 240.0]\n  resolution: [640, 480]\n"
        "cam1:\n  camera_model: pinhole\n  distortion_model: radtan\n"
        "  distortion_coeffs: [-0.3, 0.1, 0.0, 0.0]\n"
        "  intrinsics: [460.0, 459.0, 365.0, 249.0]\n  resolution: [752, 480]\n"
    )
    assert camera_of(path, "cam1").size == (752, 480)
    for name in ("cam0", None):
        with pytest.raises(InputError, match="double-sphere"):
            camera_of(path, name)


@pytest.mark.parametrize("names", ["K D R P", "k d r p"])
def test_a_message_of_ros_is_read_and_refused_where_images_are_binned(tmp_path, names):
    K, D, R, P = names.split()
    text = (
        "header:\n  frame_id: head\nheight: 480\nwidth: 640\ndistortion_model: plumb_bob\n"
        f"{D}: [-0.1, 0.01, 0.001, 0.002, 0.0]\n{K}: [500, 0, 320, 0, 501, 240, 0, 0, 1]\n"
        f"{R}: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n{P}: [500, 0, 320, 0, 0, 501, 240, 0, 0, 0, 1, 0]\n"
    )
    path = tmp_path / "camera_info.yaml"
    path.write_text(text + "binning_x: 0\nbinning_y: 0\n")
    (found,) = read_cameras(path)
    assert found.size == (640, 480)
    np.testing.assert_allclose(found.parameters, [500, 501, 320, 240, -0.1, 0.01, 0.001, 0.002, 0])
    path.write_text(text + "binning_x: 2\nbinning_y: 2\n")
    with pytest.raises(InputError, match="binned"):
        read_cameras(path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1 OPENCV 1280 960 1000.0 1000.0 640 480 -0.2 0.08 5e-4\n", "expected 8 numbers"),
        ("<?xml version='1.0'?>\n<calibration>\n<f>1000</f>\n</calibration>\n", "OpenCV writes"),
        ("image_width: 640\n", "lacks this"),
        ("this is: [not", "not a camera file"),
        ("", "not a camera file"),
        (
            "camera_matrix: {rows: 1, cols: 2, data: [1, 2]}\nimage_width: 1\nimage_height: 1\n",
            "expected 9 finite numbers, got 2",
        ),
        (
            (
                "camera_matrix: {rows: 3, cols: 3, data: [1, 0, 1, 0, .nan, 1, 0, 0, 1]}\n"
                "image_width: 1\nimage_height: 1\n"
            ),
            "number 5 is none",
        ),
    ],
)
def test_bad_files_are_errors_that_name_them(tmp_path, text, said):
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"bad\.yaml") as caught:
        read_cameras(path)
    assert said in str(caught.value)


SIZED = "image_width: 640\nimage_height: 480\n"
BRACKETS = "camera_matrix: {rows: 3, cols: 3, data: [500, %s, 320, 0, 500, 240, 0, 0, 1]}\n"
FOUR = "distortion_coefficients: {rows: 1, cols: 4, data: [-0.01, 0.01, 0.0, 0.0]}\n"
EIGHT = "distortion_coefficients: {rows: 1, cols: 8, data: [0.1, 0.01, 0, 0, 0, 0.2, 0, 0]}\n"
CHAIN = "cam0:\n  camera_model: %s\n  distortion_model: %s\n  intrinsics: [500, 500, 320, 240]\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (SIZED + BRACKETS % 3 + FOUR, "skew"),
        (SIZED + BRACKETS % 0 + FOUR + "xi: 1.2\n", "omnidirectional"),
        (SIZED + BRACKETS % 0 + FOUR, "may be Brown's k1, k2, p1, p2 or the fisheye lens's"),
        (SIZED + "model_type: MEI\nprojection_parameters: {gamma1: 1}\n", "omnidirectional"),
        (BRACKETS % 0 + EIGHT.replace("0.2", "0.0"), "lacks this; add it, in pixels"),
        ("M1: {data: [1]}\nM2: {data: [1]}\n", "a file of two cameras"),
        (CHAIN % ("pinhole", "fov"), "field-of-view"),
        (CHAIN % ("omni", "radtan"), "omnidirectional"),
        (CHAIN % ("ds", "none"), "double-sphere"),
    ],
)
def test_other_lenses_are_refused_by_their_names(tmp_path, text, said):
    path = tmp_path / "lens.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=said):
        read_cameras(path)


@pytest.mark.parametrize(
    ("text", "lens", "coefficients"),
    [
        (SIZED + BRACKETS % 0 + FOUR + "fisheye: 1\n", "fisheye", [-0.01, 0.01, 0, 0]),
        (
            SIZED + BRACKETS % 0 + FOUR + "distortion_model: fisheye\n",
            "fisheye",
            [-0.01, 0.01, 0, 0],
        ),
        (SIZED + BRACKETS % 0 + FOUR + "fisheye_model: 1\n", "fisheye", [-0.01, 0.01, 0, 0]),
        (SIZED + BRACKETS % 0 + FOUR + "flags_calibration: fisheye\n", "fisheye", [-0.01, 0.01]),
        (SIZED + BRACKETS % 0 + EIGHT, "rational", [0.1, 0.01, 0, 0, 0]),
        (
            SIZED + BRACKETS % 0 + EIGHT + "distortion_model: rational_polynomial\n",
            "rational",
            [0.1, 0.01, 0, 0, 0],
        ),
        (
            CHAIN % ("pinhole", "equidistant")
            + "  distortion_coeffs: [-0.01, 0.01, 0.02, 0.0]\n  resolution: [640, 480]\n",
            "fisheye",
            [-0.01, 0.01, 0.02],
        ),
    ],
)
def test_fisheye_and_rational_lenses_are_read_as_such(tmp_path, text, lens, coefficients):
    path = tmp_path / "lens.yaml"
    path.write_text(text)
    (found,) = read_cameras(path)
    assert found.lens == lens
    assert found.distortion[: len(coefficients)].tolist() == coefficients
    if lens == "rational":
        assert found.parameters[10:].tolist() == [0.2, 0, 0]


@pytest.mark.parametrize("file_format", ["opencv", "ros", "kalibr"])
@pytest.mark.parametrize("lens", ["fisheye", "rational"])
def test_other_lenses_are_read_back_where_a_format_has_them(tmp_path, file_format, lens):
    focal = LENS[:4]
    rational = np.array([0.3, 0.1, 1e-3, -1e-3, 0.02, 0.6, 0.2, 0.03])
    values = {
        "fisheye": fisheye_parameters(focal, np.array([0.02, -0.01, 0.004, -0.001])),
        "rational": rational_parameters(focal, rational),
    }[lens]
    camera = Camera("wide", SIZE, values)
    if (file_format, lens) == ("kalibr", "rational"):
        with pytest.raises(GtvalError, match="no rational lens"):
            write_camera(".yaml", file_format, camera)
        return
    path = tmp_path / "wide.yaml"
    path.write_bytes(write_camera(".yaml", file_format, camera))
    (found,) = read_cameras(path)
    np.testing.assert_allclose(found.parameters, values, rtol=1e-15)


def test_a_rational_lens_without_its_own_coefficients_is_browns(tmp_path):
    path = tmp_path / "plain.yaml"
    lens = "distortion_coefficients: {data: [-0.1, 0.01, 0, 0, 1.0e-3, 0, 0, 0]}\n"
    path.write_text(SIZED + BRACKETS % 0 + lens)
    assert read_cameras(path)[0].parameters[4:].tolist() == [-0.1, 0.01, 0, 0, 1e-3]


def test_a_missing_file_and_a_broken_mat(tmp_path):
    with pytest.raises(InputError, match="no such camera file"):
        read_cameras(tmp_path / "none.yaml")
    path = tmp_path / "Calib_Results.mat"
    path.write_bytes(b"nonsense")
    with pytest.raises(InputError, match="not a MATLAB file"):
        read_cameras(path)


@pytest.mark.parametrize(
    ("file_format", "suffix"),
    [("bouguet", ".m"), ("bouguet", ".yaml"), ("ros", ".mat"), ("opencv", ".npz"), ("kalibr", "")],
)
def test_no_file_is_named_as_one_of_another_format(file_format, suffix):
    wanted = SUFFIXES[file_format]
    with pytest.raises(GtvalError, match=rf"format {file_format} is named \{wanted}"):
        write_camera(suffix, file_format, a_camera())


def test_kalibr_cannot_hold_k3():
    with pytest.raises(GtvalError, match="no k3"):
        write_camera(".yaml", "kalibr", a_camera(-0.015))


BROWN = [-0.28, 0.07, 0.0002, 1e-5, 0.0]
OTHERS = {
    "euroc.yaml": """
sensor_type: camera
T_BS: {cols: 4, rows: 4, data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}
resolution: [640, 480]
camera_model: pinhole
intrinsics: [500, 501, 320, 240]
distortion_model: radial-tangential
distortion_coefficients: [-0.28, 0.07, 0.0002, 1.0e-05]
""",
    "camodocal.yaml": """%YAML:1.0
---
model_type: PINHOLE
camera_name: other
image_width: 640
image_height: 480
distortion_parameters: {k1: -0.28, k2: 0.07, p1: 0.0002, p2: 1.0e-05}
projection_parameters: {fx: 500, fy: 501, cx: 320, cy: 240}
""",
    "sample.yml": """%YAML:1.0
---
image_width: 640
image_height: 480
fisheye_model: 0
camera_matrix: {rows: 3, cols: 3, dt: d, data: [500, 0, 320, 0, 501, 240, 0, 0, 1]}
distortion_coefficients: {rows: 4, cols: 1, dt: d, data: [-0.28, 0.07, 0.0002, 1.0e-05]}
""",
    "script.json": """{"camera_matrix": [[500, 0, 320], [0, 501, 240], [0, 0, 1]],
"dist_coeff": [[-0.28, 0.07, 0.0002, 1.0e-05, 0.0]], "image_width": 640, "image_height": 480}""",
}


@pytest.mark.parametrize("name", OTHERS)
def test_files_of_other_programs_are_read(tmp_path, name):
    path = tmp_path / name
    path.write_text(OTHERS[name])
    (found,) = read_cameras(path)
    assert found.size == (640, 480)
    assert found.parameters.tolist() == pytest.approx([500, 501, 320, 240, *BROWN])


@pytest.mark.parametrize(
    ("contents", "said"),
    [
        ({"kc": np.zeros((4, 1))}, "fisheye lens"),
        ({"fc_left": np.zeros((2, 1))}, "two cameras"),
    ],
)
def test_files_of_bouguets_other_toolboxes_are_named(tmp_path, contents, said):
    from scipy.io import savemat

    path = tmp_path / "Calib_Results.mat"
    savemat(path, {"fc": np.ones((2, 1)), **contents})
    with pytest.raises(InputError, match=said):
        read_cameras(path)
    program = tmp_path / "Calib_Results.m"
    program.write_text("fc = [ 657.39 ; 657.76 ];")
    with pytest.raises(InputError, match=r"give the Calib_Results\.mat"):
        read_cameras(program)
    program.write_text("ocam_model.ss = [-200; 0; 0.001];")
    with pytest.raises(InputError, match="OCamCalib"):
        read_cameras(program)
