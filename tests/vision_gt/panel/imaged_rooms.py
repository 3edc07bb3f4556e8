"""Folders of images that cameras might have taken, small and quick to make."""

import cv2
import numpy as np

TOML = """
name = "A room"

[vision.board]
columns = 10
rows = 6
square = 0.1

[vision.reference]
board = { columns = 10, rows = 6, square = 0.1 }
position = [0.2, 0.0]
"""
SIZE = (640, 480)


def reference_image(seed=0):
    """A chessboard on a grey floor, from above and aslant; and its first inner corner and row."""
    rng = np.random.default_rng([20261129, seed])
    white = (np.indices((6, 10)).sum(0) % 2).astype(np.uint8)
    board = np.kron(255 * white, np.ones((40, 40), np.uint8))
    board = np.pad(board, 30, constant_values=255)
    height, width = board.shape
    corners = np.float32([[0, 0], [width, 0], [width, height], [0, height]])
    seen = np.float32([[150, 120], [470, 140], [520, 350], [110, 330]]) + rng.uniform(
        -25, 25, (4, 2)
    )
    H = cv2.getPerspectiveTransform(corners, np.float32(seen))
    image = cv2.warpPerspective(board, H, SIZE, borderValue=110, flags=cv2.INTER_AREA)
    image = cv2.GaussianBlur(image, (0, 0), 0.8).astype(float) + rng.normal(0, 3, image.shape)
    ends = np.array([[[70.0, 70.0]], [[390.0, 70.0]], [[70.0, 230.0]]]) - 0.5
    places = cv2.perspectiveTransform(ends, H).reshape(3, 2)
    return np.clip(image, 0, 255).astype(np.uint8), places


def written(folder, cameras=4, others=0):
    """A campaign of reference images by some cameras, and of others that show noise."""
    (folder / "vision/reference").mkdir(parents=True)
    places = {}
    for number in range(1, cameras + 1):
        image, places[str(number)] = reference_image(number)
        cv2.imwrite(str(folder / f"vision/reference/{number}.png"), image)
    small = np.random.default_rng(1).integers(0, 255, (60, 80)).astype(np.uint8)
    for number in range(others):
        path = folder / f"vision/poses/{number % 4 + 1}/pose{number // 4 + 1}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(path), small)
    for moment in ("before", "after"):
        path = folder / f"vision/steadiness/{moment}/1.png"
        path.parent.mkdir(parents=True)
        cv2.imwrite(str(path), reference_image(9)[0])
    for at in range(3):
        path = folder / f"vision/drive/1/170000000{at}.5.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(path), small)
    (folder / "campaign.toml").write_text(TOML)
    return places
