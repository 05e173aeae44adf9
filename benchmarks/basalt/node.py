"""The Basalt node of the package depthai on one sequence, without a device: what `benchmarks.basalt.trial` starts.

    LD_PRELOAD=SHIM BASALT_CALIBRATION=FILE BASALT_CORE=NAME ENV/bin/python node.py JOB

The environment needs depthai, NumPy and OpenCV, and not tracknoise. A frame is sent when the pose of the frame before
it is there, so that nothing is dropped and runs repeat exactly. Exits with status 2 if a pose does not come within
`PATIENCE_S`. JOB is a JSON file, of cameras of one size without distortion, the first with an inertial sensor in it:

sequence, times_ns: folder in the layout of EuRoC, and the times of its frames, ns
size, intrinsics: width and height, px, and fx, fy, cx, cy of each camera, px
first_from_second: pose of the second camera, 4 x 4, metres
readings: CSV file of times, ns, angular rates, rad/s, and accelerations, m/s^2
gyro, accelerometer: densities of their noise, rad/s and m/s^2 per sqrt(Hz)
config, poses: configuration of Basalt, and CSV file to write
"""

import json
import os
import sys
import time
from collections.abc import Mapping
from datetime import timedelta
from pathlib import Path
from typing import Any

import cv2
import depthai as dai
import numpy as np

PATIENCE_S = 20.0
START_NS = 10**9
"""Time of the first frame, in the node."""
AHEAD_NS = 60_000_000
"""Readings are sent until so long after their frame: the node waits for readings beyond a frame."""
SOCKETS = (dai.CameraBoardSocket.CAM_B, dai.CameraBoardSocket.CAM_C)
_CM_PER_M = 100.0


def write_calibration(job: Mapping[str, Any], path: str) -> None:
    """The file that is read instead of a device's memory; lengths are in cm."""
    calibration = dai.CalibrationHandler()
    for socket, (fx, fy, cx, cy) in zip(SOCKETS, job["intrinsics"], strict=True):
        calibration.setCameraIntrinsics(socket, [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], *job["size"])
        calibration.setDistortionCoefficients(socket, [0.0] * 14)
        calibration.setCameraType(socket, dai.CameraModel.Perspective)
    pose = np.array(job["first_from_second"])
    shift = (pose[:3, 3] * _CM_PER_M).tolist()
    calibration.setCameraExtrinsics(SOCKETS[1], SOCKETS[0], pose[:3, :3].tolist(), shift, shift)
    calibration.setImuExtrinsics(SOCKETS[0], np.eye(3).tolist(), [0.0] * 3, [0.0] * 3)
    calibration.eepromToJsonFile(path)


def run(pipeline: Any, job: Mapping[str, Any]) -> list[list[float]]:
    """Positions, m, and quaternions w x y z of the first camera, with axes forward, left and up, for each frame."""
    node = pipeline.create(dai.node.BasaltVIO)
    node.runSyncOnHost(True)
    node.setImuUpdateRate(200)
    # in spite of their names, both take variances
    node.setAccelNoiseStd([job["accelerometer"] ** 2] * 3)
    node.setGyroNoiseStd([job["gyro"] ** 2] * 3)
    node.setConfigPath(job["config"])
    inputs = (node.left, node.right, node.imu)
    for entry in inputs:
        entry.setBlocking(True)
    *views, inertial = (entry.createInputQueue(maxSize=1000, blocking=True) for entry in inputs)
    moved = node.transform.createOutputQueue(maxSize=1000, blocking=True)
    pipeline.start()
    readings, sent = np.loadtxt(job["readings"], delimiter=","), 0
    poses: list[list[float]] = []
    for index, time_ns in enumerate(job["times_ns"]):
        for camera, view in enumerate(views):
            path = f"{job['sequence']}/mav0/cam{camera}/data/{time_ns}.png"
            view.send(_frame(path, SOCKETS[camera], time_ns - job["times_ns"][0] + START_NS, index))
        if index == 0:
            time.sleep(1.0)  # readings are dropped until the node has taken its first frames
        upto = int(np.searchsorted(readings[:, 0], time_ns + AHEAD_NS, side="right"))
        inertial.send(_packets(readings[sent:upto], job["times_ns"][0] - START_NS))
        sent, end = upto, time.monotonic() + PATIENCE_S
        while (found := moved.tryGet()) is None:
            if time.monotonic() > end:
                return poses
            time.sleep(0.002)
        at, turn = found.getTranslation(), found.getQuaternion()
        poses.append([at.x, at.y, at.z, turn.qw, turn.qx, turn.qy, turn.qz])
    return poses


def _frame(path: str, socket: Any, time_ns: int, index: int) -> Any:
    image, frame = np.asarray(cv2.imread(path, cv2.IMREAD_GRAYSCALE)), dai.ImgFrame()
    frame.setType(dai.ImgFrame.Type.GRAY8)
    frame.setWidth(image.shape[1])
    frame.setHeight(image.shape[0])
    frame.setData(image.reshape(-1))
    frame.setInstanceNum(int(socket))
    frame.setTimestamp(timedelta(microseconds=time_ns / 1000))
    frame.setSequenceNum(index)
    return frame


def _packets(rows: Any, start_ns: int) -> Any:
    data, packets = dai.IMUData(), []
    for time_ns, *values in rows.tolist():
        packet, gyro, force = dai.IMUPacket(), dai.IMUReportGyroscope(), dai.IMUReportAccelerometer()
        stamp = dai.Timestamp()
        gyro.x, gyro.y, gyro.z, force.x, force.y, force.z = values
        stamp.sec, stamp.nsec = divmod(int(time_ns) - start_ns, 10**9)
        gyro.timestamp = force.timestamp = stamp
        packet.gyroscope, packet.acceleroMeter = gyro, force
        packets.append(packet)
    data.packets = packets
    return data


if __name__ == "__main__":
    work = json.loads(Path(sys.argv[1]).read_text())
    write_calibration(work, os.environ["BASALT_CALIBRATION"])
    kept = dai.Pipeline(False)  # its end would wait for threads that do not end
    found = run(kept, work)
    np.savetxt(work["poses"], np.array(found), delimiter=",")
    os._exit(0 if len(found) == len(work["times_ns"]) else 2)
