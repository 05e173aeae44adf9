"""How fast simulated frames are rendered, on one core."""

from benchmarks.harness import Row, median_ms
from tracknoise.sequences.simulated import Simulated

REPEATS = 5


def rows() -> list[Row]:
    """Frames per second at 800x600 with 2x2 rays a pixel, noise included, and what depth maps and worlds cost."""
    table = []
    reader = Simulated()
    for sequence_id in reader.sequences():
        sequence = reader.open(sequence_id)
        size = f"{reader.width}x{reader.height}"
        image_ms = median_ms(lambda at=sequence: at.image(1), REPEATS)
        table.append(Row(f"rendering {sequence_id.scene}, {size}, 2x2 rays a pixel", 1e3 / image_ms, "frames/s"))
        table.append(Row(f"exact depth map {sequence_id.scene}, {size}", median_ms(lambda at=sequence: at.depth(1), REPEATS), "ms"))
        first_ms = median_ms(lambda name=sequence_id: reader.open(name).cast(0, sequence.camera.bearings), 3)
    return table
