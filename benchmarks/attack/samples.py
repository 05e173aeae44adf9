"""Small valid files of every kind that tracknoise reads, written by its own writers where it has them."""

import json
import os
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import polars as pl

from tracknoise.experiments.load import load_experiment, preset_names
from tracknoise.geometry.cameras import Camera
from tracknoise.paper.dtu import CALIBRATION, LEDS, POSITIONS, write_mat
from tracknoise.paper.light_stage import led_positions
from tracknoise.sequences.images import encode_png
from tracknoise.sequences.kitti_files import Drive, write_record, write_scan
from tracknoise.sequences.kitti_writer import write_calibration
from tracknoise.tables.files import write_parquet
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.manifest import Manifest, SequenceEntry
from tracknoise.tables.schema import MOMENTS
from tracknoise.tables.store import RunFolder

SIZE = (24, 16)
"""Width and height of the images, px."""
FRAMES = 3

_OPTIONS = [
    ("tracker", "lucas-kanade", {"rejection": {"model": "homography", "threshold_px": 3.0}}),
    ("tracker", "correspondence", {"max_missed_frames": 2}),
    ("tracker", "oracle", {"bias_px": [0.5, 0.0], "covariance_px2": [[0.25, 0.0], [0.0, 0.25]]}),
    ("tracker", "imported", {"path": "tracks/{scene}_{lighting}_{speed}.csv"}),
    ("reader", "simulated", {"motions": ["sideways"], "frames": 20, "hfov_deg": 60.0, "seed": 1}),
    ("reader", "kitti", {"radius_px": 1.0, "keep_still": True, "depth_root": "depths"}),
]
_EXPERIMENT = """
name = "attack"
speeds = [1, 2]
seed = 7
keep = "statistics"
[dataset]
reader = "simulated"
scenes = ["sideways-00"]
max_frames = 12
[dataset.options]
motions = ["sideways"]
frames = 20
noise_sigma = 2.5
[[views]]
rotation = 90
direction = "backward"
speeds = [2]
[[trackers]]
kind = "imported"
name = "mine"
[trackers.options]
path = "tracks/{scene}_{speed}.csv"
[[trackers]]
kind = "lucas-kanade"
[truth]
scan_radius_px = 0.25
[statistics]
trim_percentile = 90.0
min_features = 5
[findings]
margin = 0.1
level = 0.95
"""
_OBJ = """mtllib quad.mtl
v 0 0 0
v 1 0 0
v 1 0 1
v 0 0 1
vt 0 0
vt 1 0
vt 1 1
vt 0 1
usemtl wall
f 1/1 2/2 3/3 4/4
usemtl red
f -4//1 -3//1 -2//1
"""
_MTL = "newmtl wall\nKd 0.2 0.4 0.6\nmap_Kd wall.png\nnewmtl red\nKd 1.0 0 0\n"
_DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="cm" meter="0.01"/><up_axis>Z_UP</up_axis></asset>
<library_images><image id="image"><init_from>wall.png</init_from></image></library_images>
<library_effects><effect id="effect"><profile_COMMON>
<newparam sid="surface"><surface type="2D"><init_from>image</init_from></surface></newparam>
<newparam sid="sampler"><sampler2D><source>surface</source></sampler2D></newparam>
<technique sid="common"><phong><diffuse><texture texture="sampler" texcoord="UV"/></diffuse></phong></technique>
</profile_COMMON></effect>
<effect id="plain"><profile_COMMON><technique sid="common"><lambert><diffuse><color>0.2 0.4 0.6 1</color></diffuse>
</lambert></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="material"><instance_effect url="#effect"/></material>
<material id="blue"><instance_effect url="#plain"/></material></library_materials>
<library_geometries><geometry id="square"><mesh>
<source id="position"><float_array id="p" count="12">-1 0 -1 1 0 -1 1 0 1 -1 0 1</float_array><technique_common>
<accessor source="#p" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<source id="texcoord"><float_array id="t" count="8">0 0 1 0 1 1 0 1</float_array><technique_common>
<accessor source="#t" count="4" stride="2"><param name="S" type="float"/><param name="T" type="float"/>
</accessor></technique_common></source>
<vertices id="vertices"><input semantic="POSITION" source="#position"/></vertices>
<triangles material="wall" count="2"><input semantic="VERTEX" source="#vertices" offset="0"/>
<input semantic="TEXCOORD" source="#texcoord" offset="0"/><p>0 1 2 0 2 3</p></triangles>
<polylist material="blue" count="1"><input semantic="VERTEX" source="#vertices" offset="0"/>
<input semantic="TEXCOORD" source="#texcoord" offset="1"/><vcount>4</vcount><p>0 0 1 1 2 2 3 3</p></polylist>
</mesh></geometry></library_geometries>
<library_nodes><node id="part"><instance_geometry url="#square"/></node></library_nodes>
<library_visual_scenes><visual_scene id="scene">
<node id="a"><translate>10 0 0</translate><rotate>0 0 1 90</rotate><scale>1 1 3</scale>
<instance_geometry url="#square"><bind_material><technique_common>
<instance_material symbol="wall" target="#material"/><instance_material symbol="blue" target="#blue"/>
</technique_common></bind_material></instance_geometry></node>
<node id="b"><matrix>1 0 0 0 0 1 0 0 0 0 1 5 0 0 0 1</matrix><instance_node url="#part"/></node>
</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#scene"/></scene>
</COLLADA>
"""
_STL = """solid one
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 1 0
endloop
endfacet
endsolid one
solid two
facet normal 0 0 1
outer loop
vertex 0 0 1
vertex 1 0 1
vertex 0 1 1
endloop
endfacet
endsolid two
"""
_SCRIPT = """material Wall/Textured : Base
{
  technique
  {
    pass
    {
      diffuse 0.5 0.5 1e-1 1
      texture_unit
      {
        texture wall.png
      }
    }
  }
}
material Wall/Plain { technique { pass {
  diffuse 1 0 0 1
} } }
"""
_WORLD = """<?xml version="1.0"?>
<sdf version='1.6'>
<world name='w'>
<scene><sky><time>10</time></sky></scene>
<light name='sun' type='directional'><pose>0 0 10 0 0 0</pose></light>
<include><uri>model://obj</uri><name>a</name><pose>1 2 3 0 0 1.57</pose></include>
<include><uri>model://dae</uri></include>
<model name='m'><pose>0 0 5 0 0 0</pose><link name='l'><pose degrees='true'>0 0 0 0 90 0</pose>
<visual name='v1'><geometry><box><size>1 2 3</size></box></geometry>
<material><diffuse>1 0 0 1</diffuse></material></visual>
<visual name='v2'><pose rotation_format='quat_xyzw'>1 0 0 0 0 0 1</pose><transparency>0</transparency>
<geometry><sphere><radius>1.5</radius></sphere></geometry></visual>
<visual name='v3'><geometry><cylinder><radius>1</radius><length>2</length></cylinder></geometry></visual>
<visual name='v4'><geometry><plane><normal>0 1 1</normal><size>4 4</size></plane></geometry></visual>
</link><model name='inner'><pose relative_to='__model__'>1 0 0 0 0 0</pose></model></model>
<state world_name='w'><model name='a'><pose>4 5 6 0 0 0</pose><scale>1 1 1</scale></model></state>
</world>
</sdf>
"""


_SIGMA = {"value": 0.3, "low": 0.2, "high": 0.4}
_FACTOR = {"of": "texture", "log_knots": [0.0, 2.0], "log_factor": [1.0, -1.0], "gain": {"value": 0.1}}
_COMPONENT = {"covariance": [[0.09, 0.01], [0.01, 0.08]], "sigma": _SIGMA, "why_dropped": None}
_NOISE_MODEL = {
    "format": "tracknoise.noise/2",
    "training": {
        "dataset": "made",
        "tracker": "lk",
        "speed": 1,
        "tracker_settings": {"kind": "lucas-kanade"},
        "scenes": ["a", "b"],
        "n_tracks": 300,
        "n_observations": 9000,
        "ages": [1, 30],
    },
    "camera": {"width": 640, "height": 480, "focal_px": 460.0, "rate_hz": 20.0, "notes": []},
    **dict.fromkeys(("first", "white", "walk", "drift"), _COMPONENT),
    "tails": {"nu": 4.0, "core_sigma": 0.2, "core_ratio": 0.7},
    "outlier_share": 0.01,
    "outliers_beyond_px": 3.0,
    "bias": {"kind": "by_age", "why": "the scenes agree", "ages": [1, 2], "mean_px": [[0.1, 0.0], [0.2, 0.1]]},
    "conditions": [_FACTOR],
    "track_scale": {
        "nu": {"value": 3.0},
        "first": _COMPONENT,
        "white": _COMPONENT,
        "walk": _COMPONENT,
        "conditions": [_FACTOR],
        "gain": {"value": 0.2},
    },
    "common_share": {"value": 0.1, "low": 0.05, "high": 0.2},
    "truth_floor_px": 0.05,
    "equivalents": [
        {
            "landmark": landmark,
            "purpose": purpose,
            "window": window,
            "sigma": _SIGMA,
            "gate_95": 1.1,
            "gate_99": 1.3,
            "gate_80": 1.0,
            "simulated": False,
        }
        for landmark in ("free", "exact", "state")
        for purpose in ("innovations", "all_poses", "newest_pose")
        for window in (11, 30)
    ],
    "kernels": [
        {
            "kind": kind,
            "knee_px": 0.4,
            "sigma_ratio": {"value": 0.8},
            "error_ratio": {"value": 0.9},
            "windows": 20,
            "all_poses_ratio": {"value": 0.85},
        }
        for kind in ("cauchy", "huber")
    ],
}


def experiments(folder: Path) -> None:
    """Every preset with its options written out, and one experiment with every section."""
    folder.mkdir()
    (folder / "all.toml").write_text(_EXPERIMENT)
    for name in preset_names():
        if name != "demo":  # its data are in a folder that need not exist here
            (folder / f"{name}.toml").write_text(load_experiment(name, root=folder).to_toml())


def noise_model(folder: Path) -> None:
    """A model with every kind of part."""
    folder.mkdir()
    (folder / "noise.json").write_text(json.dumps(_NOISE_MODEL))


def options(folder: Path) -> None:
    """Options of trackers and readers."""
    folder.mkdir()
    (folder / "options.json").write_text(json.dumps(_OPTIONS))


def tracks(folder: Path) -> None:
    """Imported tracks in all formats, of different column types and compressions."""
    folder.mkdir()
    rows = [(track, frame, 10.0 + frame, 5.0 + track, 0.5) for track in range(6) for frame in range(4)]
    table = pl.DataFrame(rows, schema=["track", "frame", "u_px", "v_px", "quality_sure"], orient="row")
    table.write_csv(folder / "tracks.csv")
    for compression in ("zstd", "snappy", "uncompressed"):
        table.write_parquet(folder / f"{compression}.parquet", compression=compression)
    table.with_columns(pl.col("track").cast(pl.String), response=pl.lit(None, pl.Float32)).write_parquet(
        folder / "text.parquet"
    )

    lines = [f"{track} {frame / 10} {u} {v}" for track, frame, u, v, _ in rows]
    (folder / "events.txt").write_text("# id t x y\n" + "\n".join(lines) + "\n")
    descriptor = ",".join(["0.0", "1.0"] * 4)
    dump = [f"{frame * 1e8:.18e},{track},{u:.18e},{v:.18e},{descriptor}" for track, frame, u, v, _ in rows]
    (folder / "xivo.txt").write_text("\n".join(dump) + "\n")
    positions = np.array(rows)[:, 2:4].reshape(6, 4, 2)
    np.savez(folder / "tap.npz", tracks=positions, occluded=positions[..., 0] > 12)
    np.savez_compressed(folder / "packed.npz", tracks=positions, visible=positions[..., 0] <= 12)
    _colmap(folder / "colmap.db", positions)


def _colmap(path: Path, positions: np.ndarray) -> None:
    """A COLMAP database in which every keypoint is matched with that of the same number in the next image."""
    count, n_images = positions.shape[:2]
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("CREATE TABLE images (image_id INTEGER PRIMARY KEY, name TEXT)")
        for name in ("keypoints (image_id", "two_view_geometries (pair_id"):
            database.execute(f"CREATE TABLE {name} INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB)")
        same = np.repeat(np.arange(count, dtype=np.uint32), 2).tobytes()
        for image in range(1, n_images + 1):
            points = positions[:, image - 1].astype(np.float32).tobytes()
            database.execute("INSERT INTO images VALUES (?, ?)", (image, f"{image:03}.png"))
            database.execute("INSERT INTO keypoints VALUES (?, ?, 2, ?)", (image, count, points))
            pair = image * (2**31 - 1) + image + 1
            database.execute("INSERT INTO two_view_geometries VALUES (?, ?, 2, ?)", (pair, count, same))


def images(folder: Path) -> None:
    """Images and depth maps of every format."""
    for name in ("gray", "depth"):
        (folder / name).mkdir(parents=True)
    colour = np.random.default_rng(0).integers(0, 256, (SIZE[1], SIZE[0], 3), dtype=np.uint8)
    for suffix in ("png", "jpg", "bmp"):
        cv2.imwrite(str(folder / "gray" / f"gray.{suffix}"), colour[..., 0])
        cv2.imwrite(str(folder / "gray" / f"colour.{suffix}"), colour)
    cv2.imwrite(str(folder / "gray" / "progressive.jpg"), colour, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])
    cv2.imwrite(str(folder / "gray" / "deep.png"), colour[..., 0].astype(np.uint16) * 257)
    cv2.imwrite(str(folder / "gray" / "bits.png"), colour[..., 0], [cv2.IMWRITE_PNG_BILEVEL, 1])
    depth = np.linspace(1.0, 5.0, SIZE[0] * SIZE[1]).reshape(SIZE[1], SIZE[0])
    cv2.imwrite(str(folder / "depth" / "16.png"), (1000 * depth).astype(np.uint16))
    packed = depth.astype("<f4").view(np.uint8).reshape(SIZE[1], SIZE[0], 4)
    cv2.imwrite(str(folder / "depth" / "float32.png"), packed)
    np.save(folder / "depth" / "float32.npy", depth.astype(np.float32))
    np.save(folder / "depth" / "columns.npy", np.asfortranarray(depth))


_CAMERA_FILES = {
    "kalibr.yaml": """cam0:
  T_cam_imu: [[0.0, 1.0, 0.0, 0.1], [-1.0, 0.0, 0.0, 0.2], [0.0, 0.0, 1.0, 0.3], [0.0, 0.0, 0.0, 1.0]]
  camera_model: pinhole
  distortion_coeffs: [0.003, 0.0007, -0.002, 0.0002]
  distortion_model: equidistant
  intrinsics: [20.0, 20.0, 11.5, 7.5]
  resolution: [24, 16]
  timeshift_cam_imu: -0.0012
cam1:
  T_cn_cnm1: [[1.0, 0.0, 0.0, -0.11], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
  camera_model: ds
  intrinsics: [-0.17, 0.59, 20.0, 20.0, 11.5, 7.5]
  resolution: [24, 16]
""",
    "euroc.yaml": """T_BS: {cols: 4, rows: 4, data: [0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}
rate_hz: 20
resolution: [24, 16]
camera_model: pinhole
intrinsics: [20.0, 20.0, 11.5, 7.5]
distortion_model: radial-tangential
distortion_coefficients: [-0.28, 0.07, 0.0002, 1.76e-05]
""",
    "opencv.yml": """%YAML:1.0
---
image_width: 24
image_height: 16
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 20., 0., 11.5, 0., 20., 7.5, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -0.28, 0.07, 0., 0., 0. ]
""",
    "opencv.xml": """<?xml version="1.0"?>
<opencv_storage>
<image_width>24</image_width>
<image_height>16</image_height>
<camera_matrix type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>d</dt>
<data>20. 0. 11.5 0. 20. 7.5 0. 0. 1.</data></camera_matrix>
</opencv_storage>
""",
    "vins.yaml": """%YAML:1.0
model_type: MEI
image_width: 24
image_height: 16
mirror_parameters: {xi: 0.9}
distortion_parameters: {k1: 0.01, k2: 0.0, p1: 0.0, p2: 0.0}
projection_parameters: {gamma1: 40.0, gamma2: 40.0, u0: 11.5, v0: 7.5}
""",
    "orb.yaml": """%YAML:1.0
Camera.type: "KannalaBrandt8"
Camera1.fx: 20.0
Camera1.fy: 20.0
Camera1.cx: 11.5
Camera1.cy: 7.5
Camera1.k1: 0.01
Camera1.k2: 0.0
Camera1.k3: 0.0
Camera1.k4: 0.0
Camera.width: 24
Camera.height: 16
""",
    "basalt.json": """{"value0": {"T_imu_cam": [{"px": 0, "py": 0, "pz": 0, "qx": 0, "qy": 0, "qz": 0, "qw": 1}],
"intrinsics": [{"camera_type": "eucm", "intrinsics": {"fx": 20, "fy": 20, "cx": 11.5, "cy": 7.5,
"alpha": 0.6, "beta": 1.1}}], "resolution": [[24, 16]], "cam_time_offset_ns": 0}}
""",
    "okvis.yaml": """cameras:
- {T_SC: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], image_dimension: [24, 16],
   distortion_coefficients: [0.01, 0, 0, 0], distortion_type: equidistant, focal_length: [20, 20],
   principal_point: [11.5, 7.5]}
""",
}


def camera_files(root: Path) -> None:
    """Cameras as several programs describe them."""
    root.mkdir()
    for name, text in _CAMERA_FILES.items():
        (root / name).write_text(text)


def networks(folder: Path) -> None:
    """A network of keypoints that gives what is in the file, and one with its numbers in another file."""
    from onnx import TensorProto, helper, numpy_helper, save_model

    folder.mkdir()
    outputs = {
        "keypoints": np.float32([[[3, 4], [5, 6], [7, 8]]]),
        "scores": np.float32([[0.5, 0.7, 0.6]]),
        "descriptors": np.ones((1, 3, 8), np.float32),
        "covariances": np.float32(np.tile(np.eye(2), (1, 3, 1, 1))),
    }
    nodes = [helper.make_node("Identity", [f"constant {name}"], [name]) for name in outputs]
    given = [helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 1, None, None])]
    shown = [helper.make_tensor_value_info(name, TensorProto.FLOAT, None) for name in outputs]
    initial = [numpy_helper.from_array(values, f"constant {name}") for name, values in outputs.items()]
    graph = helper.make_graph(nodes, "small", given, shown, initial)
    made = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=8)
    (folder / "whole.onnx").write_bytes(made.SerializeToString())
    options = {"all_tensors_to_one_file": True, "location": "numbers.data", "size_threshold": 0}
    save_model(made, folder / "external.onnx", save_as_external_data=True, **options)


def folder(root: Path) -> None:
    """A sequence in the plain layout."""
    (root / "images").mkdir(parents=True)
    (root / "depth").mkdir()
    for index in range(FRAMES):
        (root / "images" / f"{index:06d}.png").write_bytes(_gray(index))
        np.save(root / "depth" / f"{index:06d}.npy", np.full(SIZE[::-1], 2.0, np.float32))
    camera = {"width": SIZE[0], "height": SIZE[1], "fx": 20.0, "fy": 20.0, "cx": 11.5, "cy": 7.5}
    camera |= {"distortion": [0.01, -0.001, 1e-4, 0.0], "depth_unit_m": 0.001, "source": "attack"}
    (root / "camera.json").write_text(json.dumps(camera, indent=2))
    (root / "poses.txt").write_text(
        "# tx ty tz qx qy qz qw\n" + "".join(f"{i} 0 0 0 0 0.6 0.8\n" for i in range(FRAMES))
    )


def sevenscenes(root: Path) -> None:
    """A sequence of 7-Scenes."""
    root.mkdir()
    for index in range(FRAMES):
        stem = root / f"frame-{index:06d}"
        Path(f"{stem}.color.png").write_bytes(_gray(index))
        Path(f"{stem}.depth.png").write_bytes(encode_png(np.full(SIZE[::-1], 1500, np.uint16)))
        np.savetxt(f"{stem}.pose.txt", np.eye(4))
    np.savetxt(root / "camera-intrinsics.txt", np.array([[20.0, 0, 11.5], [0, 20.0, 7.5], [0, 0, 1]]))


def tartanair(root: Path) -> None:
    """A trajectory of TartanAir v1; its images must have their true size."""
    for name in ("image_left", "depth_left"):
        (root / name).mkdir(parents=True)
    for index in range(2):
        (root / "image_left" / f"{index:06d}_left.png").write_bytes(encode_png(np.zeros((480, 640), np.uint8)))
    (root / "pose_left.txt").write_text("0 0 0 0 0 0 1\n0.5 0 0 0 0 0.6 0.8\n")


def kitti(root: Path) -> None:
    """A drive of KITTI with positions of its navigation system."""
    drive = _drive(root)
    for index in range(FRAMES):
        for path in (drive.oxts(index), drive.depth(index), drive.scan(index)):
            path.parent.mkdir(parents=True, exist_ok=True)
        drive.depth(index).write_bytes(encode_png(np.full(SIZE[::-1], 512, np.uint16)))
        write_record(drive.oxts(index), np.array([49.0 + 1e-5 * index, 8.0, 100.0, 0.01, 0.02, 0.03]))
        write_scan(drive.scan(index), np.array([[2.0, 0.0, 0.0], [3.0, 1.0, 0.5]]))
    times = "".join(f"2011-09-26 13:02:25.{index}64389445\n" for index in range(FRAMES))
    drive.timestamps.write_text(times)


def kitti_poses(root: Path) -> None:
    """A drive of KITTI with a file of poses."""
    drive = _drive(root)
    drive.poses.write_text("".join(f"1 0 0 {index} 0 1 0 0 0 0 1 0\n" for index in range(FRAMES)))


def dtu(root: Path) -> None:
    """What DTU's scenes share, and a scan."""
    root.mkdir()
    variables: dict[str, Any] = {
        "fc": [2892.0, 2883.0],
        "cc": [800.0, 600.0],
        "kc": [0.01, 0.0, 0.0, 0.0, 0.0],
        "nx": 1600.0,
    }
    variables |= {"ny": 1200.0, "alpha_c": 0.0}
    for position in POSITIONS:
        variables |= {f"Rc_{position}": np.eye(3), f"Tc_{position}": np.array([[0.0], [0.0], [0.01 * position]])}
    write_mat(root / CALIBRATION, variables)
    points = np.random.default_rng(0).normal(size=(3, 20)).astype(np.float32)
    write_mat(root / "Clean_Reconstruction_01.mat", {"pts3D_near": points, "pts3D_far": points + 1})
    (root / LEDS).write_text("x,y,z\n" + "".join(f"{x},{y},{z}\n" for x, y, z in led_positions().tolist()))


def world(root: Path) -> None:
    """A world, and models with a mesh of each format."""
    root.mkdir()
    (root / "test.world").write_text(_WORLD)
    meshes = {"obj": _OBJ.encode(), "dae": _DAE.encode(), "stl": _STL.encode()}
    for name, content in meshes.items():
        model = root / "models" / name
        for below in ("meshes", "materials/textures", "materials/scripts"):
            (model / below).mkdir(parents=True)
        (model / "meshes" / f"mesh.{name}").write_bytes(content)
        (model / "materials" / "textures" / "wall.png").write_bytes(_gray(0))
        cv2.imwrite(str(model / "materials" / "textures" / "wall.jpg"), np.full((8, 16, 3), 90, np.uint8))
        (model / "materials" / "scripts" / "wall.material").write_text(_SCRIPT.replace("wall.png", "wall.jpg"))
        (model / "model.config").write_text("<model><sdf version='1.6'>model.sdf</sdf></model>")
        (model / "model.sdf").write_text(_model(name))
    (root / "models" / "obj" / "meshes" / "quad.mtl").write_text(_MTL)
    (root / "models" / "stl" / "meshes" / "binary.stl").write_bytes(_binary_stl())


def run(root: Path) -> None:
    """A run folder of one sequence; only one of its tables has rows."""
    sequence = SequenceId("folder", "scene")
    hashes = {"moments": write_parquet(root / "moments" / f"{sequence.key}.parquet", _filled(MOMENTS))}
    entry = SequenceEntry(sequence, FRAMES, *SIZE, "birth", snapshot_frame=0, seconds=1.5, notes=("a",), sha256=hashes)
    manifest = Manifest("0" * 64, {"tracknoise": "0.1.0"}, {"cores": "2"}, 0, {sequence.key: entry})
    RunFolder(root).create("name = 'attack'\n", manifest)
    (root / "report").mkdir()
    contents = {"format": 1, "figures": [{"id": "a", "title": "A", "files": ["figures/a.svg"]}], "tables": []}
    (root / "report" / "contents.json").write_text(json.dumps(contents))


def real_model(root: Path) -> None:
    """A model of the Gazebo library."""
    shutil.copytree(_real() / "gazebo_models" / "mailbox", root / "mailbox", copy_function=shutil.copyfile)
    for folder in (root, *root.rglob("*")):
        folder.chmod(0o755)


def real_files(root: Path) -> None:
    """Calibrations, poses, images and depth maps of the real samples."""
    root.mkdir()
    frame = _real() / "sevenscenes" / "seq-01" / "frame-000000"
    trajectory = _real() / "tartanair_v1" / "P000" / "pose_left.txt"
    calibration = _real() / "kitti" / "2011_09_26"
    for path in (*calibration.glob("calib*.txt"), *frame.parent.glob(f"{frame.name}*"), trajectory):
        shutil.copyfile(path, root / path.name)


def has_real_samples() -> bool:
    """Whether the environment names the folder of the real samples."""
    return bool(os.environ.get("TRACKNOISE_DATA")) and _real().is_dir()


def _real() -> Path:
    return Path(os.environ["TRACKNOISE_DATA"])


def _model(name: str) -> str:
    """A model that shows its meshes, one of them with a material script."""
    files = {"stl": ["mesh.stl", "binary.stl"]}.get(name, [f"mesh.{name}"])
    visuals = "".join(
        f"<visual name='{file}'><geometry><mesh><uri>model://{name}/meshes/{file}</uri><scale>1 2 3</scale></mesh>"
        "</geometry></visual>"
        for file in files
    )
    script = f"<script><uri>model://{name}/materials/scripts</uri><name>Wall/Textured</name></script>"
    box = f"<visual name='b'><geometry><box/></geometry><material>{script}</material></visual>"
    return f"<sdf version='1.6'><model name='{name}'><link name='l'>{visuals}{box}</link></model></sdf>"


def _binary_stl() -> bytes:
    facets = np.zeros(2, np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")]))
    facets["corners"] = np.random.default_rng(0).normal(size=(2, 3, 3))
    return b"binary".ljust(80) + (2).to_bytes(4, "little") + facets.tobytes()


def _drive(root: Path) -> Drive:
    day = root / "2011_09_26"
    drive = Drive(day / "2011_09_26_drive_0001_sync")
    drive.image(0).parent.mkdir(parents=True)
    for index in range(FRAMES):
        drive.image(index).write_bytes(_gray(index))
    write_calibration(day, Camera(*SIZE, 20.0, 20.0, 11.5, 7.5))
    return drive


def _gray(index: int) -> bytes:
    return encode_png(np.random.default_rng(index).integers(0, 256, SIZE[::-1], dtype=np.uint8))


def _filled(schema: Any, rows: int = 5) -> pl.DataFrame:
    """A table of a schema in which every cell has some value."""
    return pl.DataFrame({name: [_value(dtype)] * rows for name, dtype in schema.items()}, schema=dict(schema))


def _value(dtype: Any) -> Any:
    if isinstance(dtype, pl.Enum):
        return dtype.categories[0]
    return "a" if dtype == pl.String else True if dtype == pl.Boolean else 1.0 if dtype.is_float() else 1
