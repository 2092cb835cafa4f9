"""Writes the calibration files beside this script with OpenCV's own FileStorage, from made-up numbers.

Needs numpy and opencv-python. `expected.json` has the numbers that went in and what OpenCV's stereoRectify made of them.
"""
import json
from pathlib import Path

import cv2
import numpy as np

HERE = Path(__file__).parent
SIZE = (640, 400)
K1 = np.array([[412.25, 0, 318.5], [0, 411.75, 203.125], [0, 0, 1]])
K2 = np.array([[414.5, 0, 322.75], [0, 413.875, 198.5], [0, 0, 1]])
D1 = np.array([[-0.31, 0.105, 0.0006, -0.0009, -0.012]])
D2 = np.array([[-0.305, 0.0975, -0.0004, 0.0011, -0.0105]])
D1_8 = np.array([[-0.21, 0.055, 0.0006, -0.0009, 0.002, 0.101, 0.0125, -0.003]])
D2_8 = np.array([[-0.205, 0.0475, -0.0004, 0.0011, 0.0025, 0.0975, 0.0115, -0.0025]])
R, _ = cv2.Rodrigues(np.array([0.011, -0.023, 0.007]))
T = np.array([[-0.1205], [0.0011], [-0.0023]])


def rectify(d1, d2):
    r1, r2, p1, p2, q, *_ = cv2.stereoRectify(K1, d1, K2, d2, SIZE, R, T, flags=cv2.CALIB_ZERO_DISPARITY, alpha=0)
    return {"R1": r1, "R2": r2, "P1": p1, "P2": p2, "Q": q}


def write(name, items):
    storage = cv2.FileStorage(str(HERE / name), cv2.FILE_STORAGE_WRITE)
    for key, value in items.items():
        storage.write(key, value)
    storage.release()


def ros(name, camera, k, d, r, p):
    def matrix(key, m):
        rows, cols = m.shape
        data = ", ".join(repr(float(v)) for v in m.ravel())
        return f"{key}:\n  rows: {rows}\n  cols: {cols}\n  data: [{data}]\n"

    model = "plumb_bob" if d.size == 5 else "rational_polynomial"
    text = f"image_width: {SIZE[0]}\nimage_height: {SIZE[1]}\ncamera_name: {camera}\n"
    text += matrix("camera_matrix", k) + f"distortion_model: {model}\n" + matrix("distortion_coefficients", d)
    text += matrix("rectification_matrix", r) + matrix("projection_matrix", p)
    (HERE / name).write_text(text)


five, eight = rectify(D1, D2), rectify(D1_8, D2_8)
size = np.array([SIZE], dtype=np.int32)
whole = {"image_width": SIZE[0], "image_height": SIZE[1], "K1": K1, "D1": D1, "K2": K2, "D2": D2, "R": R, "T": T, **five}
write("whole.yml", whole)
write("whole.xml", whole)
write("pose_only.yml", {"imageSize": size, "cameraMatrix1": K1, "distCoeffs1": D1_8, "cameraMatrix2": K2, "distCoeffs2": D2_8,
                        "R": R, "T": T})
zeros = np.zeros((1, 6))
write("intrinsics.yml", {"M1": K1, "D1": np.hstack([D1_8, zeros]), "M2": K2, "D2": np.hstack([D2_8, zeros])})
write("extrinsics.yml", {"R": R, "T": T, **eight})
ros("left.yaml", "left", K1, D1, five["R1"], five["P1"])
ros("right.yaml", "right", K2, D2, five["R2"], five["P2"])
ros("left_rational.yaml", "left", K1, D1_8, eight["R1"], eight["P1"])
ros("right_rational.yaml", "right", K2, D2_8, eight["R2"], eight["P2"])


def plain(items):
    return {key: np.asarray(value).ravel().tolist() for key, value in items.items()}


given = {"size": SIZE, "K1": K1, "K2": K2, "D1": D1, "D2": D2, "D1_8": D1_8, "D2_8": D2_8, "R": R, "T": T}
expected = {**plain(given), "five": plain(five), "eight": plain(eight)}
(HERE / "expected.json").write_text(json.dumps(expected, indent=1) + "\n")
