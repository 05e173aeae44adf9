"""Small valid recordings whose images, depths and poses have times of their own, for `benchmarks.attack.parsers`."""

from pathlib import Path

import numpy as np

from tracknoise.sequences.images import encode_png
from tracknoise.sequences.kitti_files import write_scan

_SIZE = (24, 16)
_FRAMES = 3
_START_NS = 1403636579763555584
_EXTRINSICS = "T_BS:\n  cols: 4\n  rows: 4\n  data: [0, -1, 0, 0.1, 1, 0, 0, 0, 0, 0, 1, 0.2, 0, 0, 0, 1]\n"
_LENS = "intrinsics: [20, 20.5, 11.5, 7.5]\ndistortion_model: radial-tangential\nresolution: [24, 16]\n"


def tum(root: Path) -> None:
    """A recording in the format of TUM RGB-D."""
    for name, image in (("rgb", np.zeros(_SIZE[::-1], np.uint8)), ("depth", np.full(_SIZE[::-1], 5000, np.uint16))):
        (root / name).mkdir(parents=True)
        times = [f"13050312{40 + index}.0{name == 'depth':d}6303" for index in range(_FRAMES)]
        for time in times:
            (root / name / f"{time}.png").write_bytes(encode_png(image))
        rows = "".join(f"{time} {name}/{time}.png\n" for time in times)
        (root / f"{name}.txt").write_text(f"# timestamp filename\n{rows}")
    seconds = [f"13050312{40 + index}.0{tenth}" for index in range(_FRAMES) for tenth in (0, 9)]
    poses = "".join(f"{time} 1.3e0 0.6 -{index} 0 0.6 0 0.8\n" for index, time in enumerate(seconds))
    (root / "groundtruth.txt").write_text(f"# timestamp tx ty tz qx qy qz qw\n{poses}")
    (root / "calibration.txt").write_text("20 20.5 11.5 7.5\n")


def tum_pairs(root: Path) -> None:
    """A recording as ICL-NUIM has them: one list of pairs, and frames for times."""
    tum(root)
    colour, depth = ((root / f"{name}.txt").read_text().split()[4::2] for name in ("rgb", "depth"))
    rows = zip(range(_FRAMES), depth, range(_FRAMES), colour, strict=True)
    (root / "associations.txt").write_text("".join("{} {} {} {}\n".format(*row) for row in rows))
    (root / "rgb.txt").unlink()
    (root / "groundtruth.txt").rename(root / "livingRoom0.gt.freiburg")
    (root / "livingRoom0.gt.freiburg").write_text("".join(f"{index} 0 0 0 0 0 0 1\n" for index in range(_FRAMES)))


def euroc(root: Path) -> None:
    """A recording in the ASL layout."""
    device = root / "mav0"
    (device / "cam0" / "data").mkdir(parents=True)
    (device / "vicon0").mkdir()
    times = [_START_NS + 50_000_000 * index for index in range(_FRAMES)]
    for time in times:
        (device / "cam0" / "data" / f"{time}.png").write_bytes(encode_png(np.zeros(_SIZE[::-1], np.uint8)))
    rows = "".join(f"{time},{time}.png\n" for time in times)
    (device / "cam0" / "data.csv").write_text(f"#timestamp [ns],filename\n{rows}")
    lens = f"{_EXTRINSICS}rate_hz: 20\ncamera_model: pinhole\n{_LENS}"
    (device / "cam0" / "sensor.yaml").write_text(f"{lens}distortion_coefficients: [0.01, 0, 0, 0]\n")
    header = "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []\n"
    (device / "vicon0" / "data.csv").write_text(header + "".join(f"{time},1,2,-3e0,0.6,0,0.8,0\n" for time in times))
    (device / "vicon0" / "sensor.yaml").write_text(f"sensor_type: pose\n{_EXTRINSICS}")


def kitti_odometry(root: Path) -> None:
    """A sequence of KITTI odometry with Velodyne scans."""
    course = root / "sequences" / "00"
    for name in ("image_0", "velodyne"):
        (course / name).mkdir(parents=True)
    (root / "poses").mkdir()
    for index in range(_FRAMES):
        (course / "image_0" / f"{index:06d}.png").write_bytes(encode_png(np.zeros(_SIZE[::-1], np.uint8)))
        write_scan(course / "velodyne" / f"{index:06d}.bin", np.array([[2.0, 0.0, 0.0], [3.0, 1.0, 0.5]]))
    lines = "".join(f"P{camera}: 20 0 11.5 -{camera} 0 20 7.5 0 0 0 1 0\n" for camera in range(4))
    (course / "calib.txt").write_text(f"{lines}Tr: 0 -1 0 0 0 0 -1 0 1 0 0 -0.3\n")
    (course / "times.txt").write_text("".join(f"{0.1 * index:e}\n" for index in range(_FRAMES)))
    poses = "".join(f"1 0 0 0 0 1 0 0 0 0 1 {index}\n" for index in range(_FRAMES))
    (root / "poses" / "00.txt").write_text(poses)
