"""A run records the kernels that measured each sequence, and says where they differ."""

import json
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from tests.lean import without_figure_files
from threadpoolctl import threadpool_info

from tracknoise.cli.run_summary import summary_text
from tracknoise.experiments.execute import execute
from tracknoise.experiments.machine import kernels
from tracknoise.report.measured import mixed_kernels, provenance
from tracknoise.report.page import write_report
from tracknoise.report.report_data import ReportData
from tracknoise.tables.files import digest
from tracknoise.tables.manifest import Manifest

HASWELL, SKYLAKE = (f"OpenBLAS 0.3.30 {name}, NumPy X86_V3, OpenCV AVX2" for name in ("Haswell", "SkylakeX"))
MIXED = (
    "Sequences were measured on machines of different kinds (1 sequence with OpenBLAS 0.3.30 Haswell; "
    "2 sequences with OpenBLAS 0.3.30 SkylakeX), whose numbers differ by rounding."
)


def with_kernels(run, names):
    manifest = run.manifest()
    entries = sorted(manifest.sequences.items())
    manifest.sequences = {key: replace(entry, kernels=name) for (key, entry), name in zip(entries, names, strict=True)}
    run.write_manifest(manifest)
    return run


def test_kernels_of_every_loaded_blas_are_named() -> None:
    loaded = [found for found in threadpool_info() if found["user_api"] == "blas"]
    assert loaded
    for found in loaded:
        assert f"{found['version']} {found.get('architecture', '')}".strip() in kernels()
    assert "NumPy " in kernels()
    assert "OpenCV " in kernels()


def test_another_kernel_has_another_name() -> None:
    if not any("haswell" in str(found.get("architecture", "")).lower() for found in threadpool_info()):
        levels = np.show_config(mode="dicts")["SIMD Extensions"]
        if "X86_V3" not in levels.get("found", []):
            pytest.skip("this processor has no other kernel to choose")
    code = "from tracknoise.experiments.machine import kernels; print(kernels())"
    environment = {**os.environ, "OPENBLAS_CORETYPE": "Nehalem"}
    found = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert "Nehalem" in found.stdout
    assert "Nehalem" not in kernels()


def test_entries_of_a_run_have_the_kernels_of_the_process_that_measured_them(finished) -> None:
    _, run = finished(3)
    assert {entry.kernels for entry in run.manifest().sequences.values()} == {kernels()}
    data = ReportData.of(run)
    assert ["kernels", kernels()] in provenance(data).rows
    assert mixed_kernels(data) is None


def test_a_mixture_is_said_on_the_terminal_and_in_the_report(finished) -> None:
    run = with_kernels(finished(3)[1], [SKYLAKE, HASWELL, SKYLAKE])
    assert mixed_kernels(ReportData.of(run)) == MIXED
    assert MIXED in " ".join(summary_text(run).split())
    with without_figure_files():
        page = write_report(run).read_text(encoding="utf-8")
    assert MIXED in " ".join(page.split())


def test_sequences_of_an_earlier_version_are_no_mixture(finished) -> None:
    run = with_kernels(finished(3)[1], ["", HASWELL, ""])
    assert mixed_kernels(ReportData.of(run)) is None


def test_a_run_whose_manifest_does_not_name_kernels_is_read_and_resumed(finished, told) -> None:
    """A manifest of an earlier version has neither the kernels nor what is known of depths."""
    experiment, run = finished(3)
    path = run.path / "manifest.json"
    document = json.loads(path.read_text())
    for entry in document["sequences"].values():
        del entry["kernels"], entry["z_depth_from"]
    del document["sha256"]
    timeless = {key: {**entry, "seconds": None} for key, entry in document["sequences"].items()}
    seal = digest(json.dumps({**document, "sequences": timeless}).encode())
    path.write_text(json.dumps({**document, "sha256": seal}))
    entry = next(iter(Manifest.from_json(path.read_text(), place="x").sequences.values()))
    assert (entry.kernels, entry.z_depth_from) == ("", None)
    listener = told()
    assert len(execute(experiment, run, listener=listener).measured) == 3
    assert {entry.kernels for entry in run.manifest().sequences.values()} == {""}
