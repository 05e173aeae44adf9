"""One frame of one scene under the reference light, and under the first, middle and last light of each sweep."""

from collections.abc import Mapping, Sequence

from tracknoise.findings.wording import listing
from tracknoise.report.figures import light_sweeps
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.frame_image import background, size, stored_image, with_images
from tracknoise.report.figures.layout import Panel, Spec, arranged, layered
from tracknoise.report.report_data import ReportData
from tracknoise.tables.manifest import SequenceEntry

_ID, _TITLE = "light-stage", "Lighting"
_WIDTH = 180


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure. None where there is only one lighting."""
    if len(data.lightings) < 2:
        return []
    images = _images(data)
    if not images:
        return [Absence(_ID, _TITLE, "The images are missing in the run folder.")]
    entry = next(iter(images.values()))[0]
    figure = Figure(
        id=_ID,
        title=_TITLE,
        shows=f"Frame {entry.snapshot_frame} of scene {entry.sequence.scene}{data.elsewhere('lighting')} under "
        f"{data.view['lighting']}, and under the first, the middle and the last light of each group: "
        f"{listing(light_sweeps.sweeps(data))}.",
        look_for="Where shadows and bright spots move with the light, the images change although the scene does not.",
        spec=_chart(images),
        message=f"Scene {entry.sequence.scene} under {len(images)} of {len(data.lightings)} lightings",
    )
    return [figure]


def _images(data: ReportData) -> dict[str, tuple[SequenceEntry, bytes]]:
    """Sequence and image of the first scene under some lightings, the reference first, by their names."""
    scene = next(iter(data.sequences.values())).sequence.scene
    chosen = [light for names in light_sweeps.sweeps(data).values() for light in _ends_and_middle(names)]
    found: dict[str, tuple[SequenceEntry, bytes]] = {}
    for lighting in (data.view["lighting"], *dict.fromkeys(chosen)):
        wanted = {**data.view, "lighting": lighting, "scene": scene}
        for entry in data.manifest.sequences.values():
            if all(getattr(entry.sequence, name) == value for name, value in wanted.items()):
                png = stored_image(data, entry)
                found |= {} if png is None else {lighting: (entry, png)}
    return found


def _ends_and_middle(names: Sequence[str]) -> Sequence[str]:
    return names[0], names[len(names) // 2], names[-1]


def _chart(images: Mapping[str, tuple[SequenceEntry, bytes]]) -> Spec:
    """One panel per lighting, at most four in a row."""
    named = {f"image_{place}": image for place, image in enumerate(images.values())}
    panels = [
        Panel(layered(background(entry, name)).properties(title=lighting, **size(entry, _WIDTH)))
        for lighting, (name, (entry, _)) in zip(images, named.items(), strict=True)
    ]
    return with_images(arranged(panels, columns=4), named)
