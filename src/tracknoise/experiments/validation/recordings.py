"""Closed-form scenes as recordings that the package reads: files in its plain layout, and exact surfaces and scans."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.experiments.validation.closed_form import NOTHING, Array, Scene
from tracknoise.geometry.camera import Camera
from tracknoise.geometry.depth import DepthMap
from tracknoise.sequences.images import encode_png
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.sequence import Scan, TruthKind
from tracknoise.sequences.views import View
from tracknoise.tables.identity import SequenceId


def write_recording(scene: Scene, folder: Path) -> None:
    """Write a scene in the layout of docs/folder-layout.md. Images are gray: nothing looks at them."""
    for name in ("images", "depth"):
        (folder / name).mkdir(parents=True)
    picture = encode_png(_gray(scene))
    for index, depth in enumerate(depth_maps(scene)):
        (folder / "images" / f"{index:06d}.png").write_bytes(picture)
        np.save(folder / "depth" / f"{index:06d}.npy", depth)
    camera = scene.camera
    names = ("width", "height", "fx", "fy", "cx", "cy")
    (folder / "camera.json").write_text(json.dumps({name: getattr(camera, name) for name in names}), encoding="utf-8")
    rows = np.hstack([scene.positions, scene.quaternions]).tolist()
    lines = [" ".join(map(repr, row)) for row in rows]
    (folder / "poses.txt").write_text("\n".join([*lines, ""]), encoding="utf-8")


def depth_maps(scene: Scene) -> Array:
    """Depth along the optical axis at the centre of every pixel of every frame, (frames, height, width), metres."""
    rows, columns = np.indices((scene.camera.height, scene.camera.width))
    pixels = np.stack([columns, rows], axis=-1).astype(np.float64)
    shape = (scene.n_frames, *rows.shape)
    frame = np.broadcast_to(np.arange(scene.n_frames)[:, None, None], shape)
    return scene.look(frame, np.broadcast_to(pixels, (*shape, 2)))[0]


def in_memory(scene: Scene, name: SequenceId) -> RecordedSequence:
    """A recording of a scene that is not written to files."""
    depths = depth_maps(scene)
    poses = np.zeros((scene.n_frames, 4, 4))
    poses[:, :3, :3], poses[:, :3, 3], poses[:, 3, 3] = scene.rotations, scene.positions, 1.0
    camera = scene.camera
    gray = _gray(scene)
    return RecordedSequence(
        id=name,
        source=f"self-test {name.scene}",
        camera=Camera(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy),
        world_from_camera=poses,
        images=lambda _: gray,
        depths=lambda index: DepthMap(depths[index], np.ones(depths[index].shape, dtype=bool)),
    )


@dataclass(frozen=True, slots=True, eq=False)
class WithSurface(View):
    """A recording whose exact surface is known, and has been scanned.

    Parameters
    ----------
    scene
        What was recorded.
    scanned
        Scan points and key frame.
    """

    scene: Scene
    scanned: Scan | None = None

    @property
    def truths(self) -> tuple[str, ...]:
        """Birth, ray cast, and scan where there is one."""
        return TruthKind.birth, TruthKind.raycast, *(() if self.scanned is None else (TruthKind.scan,))

    @property
    def surface(self) -> "WithSurface":
        """Itself."""
        return self

    @property
    def scan(self) -> Scan | None:
        """The scan points."""
        return self.scanned

    def cast(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """First surface points under pixels: see `tracknoise.sequences.sequence.Surface.cast`."""
        frame = np.full(len(uv), index)
        depth, panel = self.scene.look(frame, uv)
        hit = panel != NOTHING
        return self.scene.world(frame, uv, np.where(hit, depth, 1.0)), hit


def _gray(scene: Scene) -> NDArray[np.uint8]:
    return np.full((scene.camera.height, scene.camera.width), 128, dtype=np.uint8)
