"""Small networks in ONNX files: one that finds bright dots, and some that match keypoints."""

from pathlib import Path

import numpy as np
import pytest

from tracknoise.trackers.keypoint_network import NetworkUnits

DOTS_SIZE = (160, 120)
COVARIANCE = np.float32([[4.0, 1.0], [1.0, 9.0]])
"""What networks with covariances predict, times the score."""
DESCRIPTOR_LENGTH = 16
"""Of the network of keypoints."""


def require_onnx() -> None:
    """Skip a test where networks cannot be made or run."""
    pytest.importorskip("onnx", reason="makes networks for these tests")
    pytest.importorskip("onnxruntime", reason="the extra `learned` is not installed")


def keypoint_network(
    path: Path,
    *,
    channels: int = 1,
    size: tuple[int, int] | None = None,
    outputs: tuple[str, ...] = ("keypoints", "scores", "descriptors"),
    units: NetworkUnits = NetworkUnits.pixels,
    inputs: int = 1,
) -> Path:
    """Write a network of bright dots: its channels, the size of its input if it has one, outputs, units of positions.

    Dots are described by what is around them.
    """
    from onnx import TensorProto, helper

    kernel = np.random.default_rng(0).normal(size=(DESCRIPTOR_LENGTH, channels, 9, 9)).astype(np.float32)
    half = np.array([(side - 1) / 2 for side in size or (1, 1)], dtype=np.float32)
    scale, shift = (1 / half, np.float32([-1, -1])) if units is NetworkUnits.minus_one_to_one else ([1, 1], [0, 0])
    constants = {
        "kernel": kernel, "least": np.float32([0.7]), "columns": np.int64([3, 2]), "rows": np.int64([0, 2, 3]),
        "scale": np.float32(scale), "shift": np.float32(shift), "zero": np.int64([0]), "one": np.int64([1]),
        "two": np.int64([2]), "inner": np.int64([1, 2]), "matrix": COVARIANCE,
    }  # fmt: skip
    nodes = [
        helper.make_node("ReduceMax", ["image", "one"], ["gray"], keepdims=1),
        helper.make_node("MaxPool", ["gray"], ["largest"], kernel_shape=[5, 5], pads=[2] * 4),
        helper.make_node("Equal", ["gray", "largest"], ["peak"]),
        helper.make_node("Greater", ["gray", "least"], ["bright"]),
        helper.make_node("And", ["peak", "bright"], ["dot"]),
        helper.make_node("NonZero", ["dot"], ["place"]),
        helper.make_node("Transpose", ["place"], ["places"], perm=[1, 0]),
        helper.make_node("Gather", ["places", "columns"], ["whole"], axis=1),
        helper.make_node("Cast", ["whole"], ["pixels"], to=TensorProto.FLOAT),
        helper.make_node("Mul", ["pixels", "scale"], ["scaled"]),
        helper.make_node("Add", ["scaled", "shift"], ["uv"]),
        helper.make_node("Unsqueeze", ["uv", "zero"], ["keypoints"]),
        helper.make_node("GatherND", ["gray", "places"], ["score"]),
        helper.make_node("Unsqueeze", ["score", "zero"], ["scores"]),
        helper.make_node("Unsqueeze", ["score", "inner"], ["weight"]),
        helper.make_node("Mul", ["weight", "matrix"], ["matrices"]),
        helper.make_node("Unsqueeze", ["matrices", "zero"], ["covariances"]),
        helper.make_node("Conv", ["image", "kernel"], ["around"], pads=[4] * 4),
        helper.make_node("Transpose", ["around"], ["vectors"], perm=[0, 2, 3, 1]),
        helper.make_node("Gather", ["places", "rows"], ["at"], axis=1),
        helper.make_node("GatherND", ["vectors", "at"], ["described"]),
        helper.make_node("LpNormalization", ["described"], ["unit"], axis=1, p=2),
        helper.make_node("Unsqueeze", ["unit", "zero"], ["descriptors"]),
    ]
    shape = [1, channels, *((None, None) if size is None else size[::-1])]
    named = dict.fromkeys(("image", *(f"more{k}" for k in range(1, inputs))), shape)
    return _write(path, nodes, named, outputs, constants)


KEYPOINTS_OF_TWO = {
    "kpts0": [1, None, 2],
    "kpts1": [1, None, 2],
    "desc0": [1, None, DESCRIPTOR_LENGTH],
    "desc1": [1, None, DESCRIPTOR_LENGTH],
}
"""Inputs of networks of matches."""


def match_network(path: Path, *, pairs: bool = True, reach: float = 0.3) -> Path:
    """Write a network that matches each keypoint with the most similar one within a reach, in units of its positions.

    Its score is the cosine of both descriptors. Two keypoints may be matched with the same one.
    """
    from onnx import TensorProto, helper

    constants = {
        "zero": np.int64([0]), "one": np.int64([1]), "two": np.int64([2]), "least": np.float32(1e-3),
        "reach": np.float32(reach**2), "nothing": np.float32(0), "start": np.int64(0), "step": np.int64(1),
    }  # fmt: skip
    nodes = [
        helper.make_node("Unsqueeze", ["kpts0", "two"], ["here"]),
        helper.make_node("Unsqueeze", ["kpts1", "one"], ["there"]),
        helper.make_node("Sub", ["here", "there"], ["apart"]),
        helper.make_node("Mul", ["apart", "apart"], ["squares"]),
        helper.make_node("Gather", ["squares", "start"], ["across"], axis=3),
        helper.make_node("Gather", ["squares", "step"], ["down"], axis=3),
        helper.make_node("Add", ["across", "down"], ["squared"]),
        helper.make_node("LessOrEqual", ["squared", "reach"], ["near"]),
        helper.make_node("Transpose", ["desc1"], ["turned"], perm=[0, 2, 1]),
        helper.make_node("MatMul", ["desc0", "turned"], ["cosine"]),
        helper.make_node("Where", ["near", "cosine", "nothing"], ["similar"]),
        helper.make_node("ArgMax", ["similar"], ["index"], axis=2, keepdims=0),
        helper.make_node("ReduceMax", ["similar", "two"], ["score"], keepdims=0),
        helper.make_node("Greater", ["score", "least"], ["good"]),
    ]
    if pairs:
        nodes += [
            helper.make_node("NonZero", ["good"], ["place"]),
            helper.make_node("Gather", ["place", "one"], ["rows"], axis=0),
            helper.make_node("Transpose", ["place"], ["places"], perm=[1, 0]),
            helper.make_node("GatherND", ["index", "places"], ["columns"]),
            helper.make_node("Unsqueeze", ["columns", "zero"], ["row"]),
            helper.make_node("Concat", ["rows", "row"], ["both"], axis=0),
            helper.make_node("Transpose", ["both"], ["matches0"], perm=[1, 0]),
            helper.make_node("GatherND", ["score", "places"], ["mscores0"]),
        ]
    else:
        constants["none"] = np.int64(-1)
        nodes += [
            helper.make_node("Where", ["good", "index", "none"], ["matches0"]),
            helper.make_node("Cast", ["score"], ["mscores0"], to=TensorProto.FLOAT),
        ]
    return _write(path, nodes, KEYPOINTS_OF_TWO, ("matches0", "mscores0"), constants)


def constant_network(
    path: Path, outputs: dict[str, np.ndarray], inputs: dict[str, list[int | None]] = KEYPOINTS_OF_TWO
) -> Path:
    """Write a network whose outputs depend on nothing."""
    from onnx import helper

    nodes = [helper.make_node("Identity", [f"constant {name}"], [name]) for name in outputs]
    return _write(path, nodes, inputs, tuple(outputs), {f"constant {name}": one for name, one in outputs.items()})


def _write(
    path: Path, nodes: list, inputs: dict[str, list[int | None]], outputs: tuple[str, ...], constants: dict
) -> Path:
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    values = {name: np.asarray(value) for name, value in constants.items()}
    given = [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in inputs.items()]
    types = {name: helper.np_dtype_to_tensor_dtype(one.dtype) for name, one in values.items()}
    types["matches0"] = types.get("constant matches0", TensorProto.INT64)
    shown = [
        helper.make_tensor_value_info(name, types.get(f"constant {name}", types.get(name, TensorProto.FLOAT)), None)
        for name in outputs
    ]
    initial = [numpy_helper.from_array(value, name) for name, value in values.items()]
    graph = helper.make_graph(nodes, "small", given, shown, initial)
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=8), path)
    return path


def with_external_data(path: Path, location: str) -> Path:
    """Move the large tensors of a network into a file beside it, and return that."""
    import onnx

    (path.parent / location).parent.mkdir(exist_ok=True)
    options = {"all_tensors_to_one_file": True, "location": location, "size_threshold": 1024}
    onnx.save_model(onnx.load(path), path, save_as_external_data=True, **options)
    return path.parent / location


ATTACKS = ("loop", "memory", "size")


def hostile_network(path: Path, attack: str) -> Path:
    """Write a network of keypoints that takes forever, takes all memory, or gives far too much."""
    from onnx import TensorProto, helper

    body = helper.make_graph(
        [helper.make_node("Identity", ["go"], ["on"]), helper.make_node("Add", ["sum", "sum"], ["next"])],
        "body",
        [
            helper.make_tensor_value_info("count", TensorProto.INT64, []),
            helper.make_tensor_value_info("go", TensorProto.BOOL, []),
            helper.make_tensor_value_info("sum", TensorProto.FLOAT, None),
        ],
        [
            helper.make_tensor_value_info("on", TensorProto.BOOL, []),
            helper.make_tensor_value_info("next", TensorProto.FLOAT, None),
        ],
    )
    rows = {"memory": 1 << 40, "size": 70_000_000}.get(attack, 1)
    nodes = [helper.make_node("ReduceMax", ["image"], ["first"], keepdims=0)]
    looped = helper.make_node("Loop", ["times", "true", "first"], ["value"], body=body)
    nodes.append(looped if attack == "loop" else helper.make_node("Identity", ["first"], ["value"]))
    nodes.append(helper.make_node("Expand", ["value", "shape"], ["keypoints"]))
    constants = {
        "times": np.int64(1 << 62), "true": np.bool_(True), "shape": np.int64([1, rows, 2]),
    }  # fmt: skip
    return _write(path, nodes, {"image": [1, 1, None, None]}, ("keypoints",), constants)
