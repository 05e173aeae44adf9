"""``tracknoise init``: an experiment file for a recording, to begin with."""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from shutil import rmtree
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli.recording_arguments import OptionOption, RecordingArgument, TrajectoryOption
from tracknoise.cli.shared_options import DebugOption, QuietOption, flag, text

if TYPE_CHECKING:
    from tracknoise.cli.recording_arguments import Recording


def init(
    context: typer.Context,
    recording: RecordingArgument,
    out: Annotated[Path | None, text("--out", "-o", metavar="FILE", help="File to write (default: NAME.toml).")] = None,
    option: OptionOption = None,
    trajectory: TrajectoryOption = None,
    camera: Annotated[
        Path | None,
        text("--camera", metavar="FILE", help="Intrinsics of the images; missing poses are reconstructed (extra sfm)."),
    ] = None,
    force: Annotated[bool, flag("--force", help="Replace the file if it exists.")] = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Recognise the format of a recording and write an experiment file for it.

    Examples: `tracknoise init /data/my-recording`, `tracknoise init tum /data/fr1 --out fr1.toml`,
    `tracknoise init /data/images --camera cam.yaml --trajectory slam.txt`,
    `tracknoise init video.mp4 --camera cam.yaml`
    """
    from tracknoise.cli.output_files import require_outputs
    from tracknoise.cli.recording_arguments import open_recording
    from tracknoise.exceptions import SettingsError
    from tracknoise.experiments.template import name_of
    from tracknoise.sequences.video import is_video
    from tracknoise.tables.files import write_atomically

    path = Path(recording[-1])
    file = out or Path(f"{name_of(path)}.toml")
    if file.exists() and not force:
        raise SettingsError(f"{file}: exists, expected a new file; --force replaces it")
    if file.exists() and file.suffix != ".toml":
        raise SettingsError(f"{file}: found a file of another kind, expected a new file or a .toml file to replace")
    require_outputs([("--out", file)], inputs=[path])
    earlier: Path | None = None
    with ExitStack() as undo:
        if is_video(path):
            folder = file.with_name(f"{file.stem}-frames")
            earlier = _set_aside(folder, undo) if force else None
            _write_frames(path, folder, camera, trajectory is None, context.obj.say)
            undo.callback(rmtree, folder)
            recording = ["folder", str(folder)]
        opened = open_recording(recording, option, trajectory=trajectory, camera=camera)
        if trajectory is None and camera is not None:
            opened = _with_poses(opened, file, context.obj.say, force=force)
        write_atomically(file, _experiment_of(opened, file).encode())
        undo.pop_all()
    if earlier is not None:
        rmtree(earlier)
    for line in _about_poses(opened):
        context.obj.result(line)
    context.obj.result(
        f"{file}: reader {opened.reader.name}. A first answer in about a minute: tracknoise run {file} --quick. "
        f"Measure all of it: tracknoise run {file}"
    )
    return 0


def _experiment_of(opened: "Recording", file: Path) -> str:
    """Text of the experiment file of a recording."""
    from tracknoise.exceptions import DataError
    from tracknoise.experiments.template import experiment_template

    try:
        return experiment_template(
            opened.reader,
            opened.path,
            opened.options,
            name=file.stem.strip("."),
            stereo=opened.stereo,
            trajectory=opened.trajectory,
            trajectory_of=opened.trajectory_of,
        )
    except DataError as error:
        if opened.trajectory is None and _lacks_poses_alone(opened):
            other = "poses of another program: --trajectory FILE, or poses from the images: --camera FILE"
            raise DataError(error.place, error.found, f"{error.expected}; {other}") from error
        raise


def _set_aside(folder: Path, undo: ExitStack) -> Path | None:
    """Where frames of an earlier video are now, which are put back if there is no new file; None without any."""
    from tracknoise.sequences.video import are_frames

    if not are_frames(folder):
        return None
    aside = folder.with_name(f".{folder.name}.earlier")
    folder.rename(aside)
    undo.callback(aside.rename, folder)
    return aside


def _write_frames(
    video: Path, folder: Path, camera: Path | None, reconstructs: bool, say: Callable[[str], None]
) -> None:
    """Write the frames of a video after what could fail was checked."""
    from tracknoise.exceptions import SettingsError
    from tracknoise.sequences.camera_files import read_camera_file
    from tracknoise.sequences.reconstruction import require_colmap
    from tracknoise.sequences.video import frame_size, write_frames

    if camera is None:
        raise SettingsError(f"{video}: a video without intrinsics, expected --camera FILE")
    if reconstructs:
        require_colmap()
    size = frame_size(video)
    stated = read_camera_file(camera, size=size).camera
    count, notes = write_frames(video, folder, (stated.width, stated.height))
    say(f"{folder}: {count} frames of {video}; {'; '.join(notes)}")


def _with_poses(opened: "Recording", file: Path, say: Callable[[str], None], *, force: bool) -> "Recording":
    """The recording with its own poses or, where it has none, with those that its images give."""
    from tracknoise.exceptions import DataError, SettingsError
    from tracknoise.sequences.estimated_poses import posed_by
    from tracknoise.sequences.poses import has_pose
    from tracknoise.sequences.reconstruction import reconstruct, trajectory_text
    from tracknoise.sequences.sequence import ImageReader
    from tracknoise.tables.files import write_atomically

    reader = opened.reader
    try:
        reader.open(reader.sequences()[0])
        return opened
    except DataError as error:
        if not isinstance(reader, ImageReader):
            raise
        why = error
    scenes = reader.recordings()
    if len(scenes) > 1:
        without = f"{len(scenes)} recordings without poses, such as {scenes[0].scene}"
        raise DataError(str(opened.path), without, "the folder of one, or --trajectory FILE")
    images = reader.open_images(scenes[0])
    poses_file = file.with_name(f"{file.stem}-poses.txt")
    if poses_file.exists() and not force:
        raise SettingsError(f"{poses_file}: exists, expected a new file; --force replaces it, --trajectory uses it")
    say(f"no poses of its own ({why})")
    poses = reconstruct(images, say=say)
    write_atomically(poses_file, trajectory_text(images, poses, "reconstructed from the images by COLMAP").encode())
    say(f"{poses_file}: poses of {int(has_pose(poses).sum())} of {len(poses)} frames")
    trajectory = str(poses_file.resolve())
    return replace(opened, reader=posed_by(reader, trajectory), trajectory=trajectory)


def _lacks_poses_alone(opened: "Recording") -> bool:
    """Whether a recording that cannot be opened could be with poses from elsewhere."""
    from tracknoise.exceptions import DataError
    from tracknoise.sequences.sequence import ImageReader

    if not isinstance(opened.reader, ImageReader):
        return False
    try:
        opened.reader.open_images(opened.reader.recordings()[0]).image(0)
    except DataError:
        return False
    return True


def _about_poses(opened: "Recording") -> list[str]:
    """Where poses are from and how many frames have one, if they are not those of the recording."""
    from tracknoise.sequences.other_poses import OtherPoses
    from tracknoise.sequences.poses import has_pose

    if opened.trajectory is None:
        return []
    first = opened.reader.open(opened.reader.sequences()[0])
    assert isinstance(first, OtherPoses), "its poses are those of the trajectory"
    posed = int(has_pose(first.world_from_camera).sum())
    return [f"poses of {posed} of {len(first)} frames are from {first.name}: {'; '.join(first.pose_notes)}"]
