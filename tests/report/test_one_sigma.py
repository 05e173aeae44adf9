"""One number for each purpose and window, wherever a run states it."""

import re

import pytest

from tracknoise.api.finished_run import open_run
from tracknoise.cli.run_summary import summary_text
from tracknoise.estimators.export_render import export, number
from tracknoise.estimators.exports import estimators
from tracknoise.estimators.run_models import run_models
from tracknoise.exceptions import UnknownNameError
from tracknoise.report.answer import summarise
from tracknoise.report.estimator_exports import exported
from tracknoise.report.noise_cells import equivalent_cells, model_sentences
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder
from tracknoise.topics.answer_summary import Summary

SPACES = str.maketrans({"\N{NO-BREAK SPACE}": " ", "\n": " "})


def set_px(text: str) -> set[str]:
    """What a text says to set, px."""
    return set(re.findall(r"[Ss]et (?:sigma )?(?:at most )?([0-9.]+) px", text.translate(SPACES)))


def stated(summary: Summary) -> set[str]:
    """On cards, in short sentences and in whole findings."""
    texts = [card.sigma for card in summary.cards]
    for finding in summary.findings:
        texts += [*(one.text for one in finding.statements), finding.details]
    return set().union(*map(set_px, texts))


def test_what_to_set_is_one_number(fitted_run: RunFolder) -> None:
    data, model = ReportData.of(fitted_run), run_models(fitted_run).models["oracle"]
    (row,) = open_run(fitted_run.path).results(quantity="sigma_to_set").to_dicts()
    expected = {f"{row['value']:.3f}"}
    assert set_px(summary_text(fitted_run)) == expected
    (to_set,) = open_run(fitted_run.path).sigma("filter").values()
    assert {f"{to_set.sigma_px:.3f}"} == expected
    assert (to_set.low_px, to_set.high_px) == pytest.approx((row["low"], row["high"]), rel=1e-12)
    assert stated(summarise(data)) == expected
    assert {f"{float(one):.3f}" for one in set_px(" ".join(model_sentences(model, "filter")))} == expected
    written = export(model, "filter").files["filter_noise.yaml"]
    assert f"sigma_px: {number(row['value'])}\n" in written
    assert (
        dict(exported(model, "oracle@1.noise.json")["filter"]["files"])["filter_noise.yaml"].partition("\n")[2]
        == (written.partition("\n")[2])
    )
    (cells,) = (
        one for one in equivalent_cells(model, row["at"]).rows if one[:2] == ["point solved for", "newest pose"]
    )
    assert f"{float(cells[2]):.3f}" in expected


def test_what_to_set_has_all_that_belongs_to_sigma(fitted_run: RunFolder) -> None:
    run = open_run(fitted_run.path)
    gated, robust = run.sigma("OpenVINS")["oracle"], run.sigma("sliding_window")["oracle"]
    assert gated.kernel is None
    assert gated.track_gate is not None
    assert (robust.track_gate, robust.knee is not None) == (None, True)
    assert gated.innovations_px > 0.0
    card = gated._repr_html_()
    assert f"{gated.sigma_px:.3f}" in card
    assert gated.caveat in card
    assert len(card.split("<tr>")) <= 11
    text = export(run_models(fitted_run).models["oracle"], "openvins").files["openvins_noise.yaml"]
    lines = text.splitlines()
    header = "\n".join(line for line in lines if line.startswith("#"))
    written = dict(line.split(": ") for line in lines if not line.startswith("#"))
    pairs = [(gated.sigma_px, gated.track_gate), (gated.state_sigma_px, gated.observation_gate)]
    for name, pair in zip(("msckf", "slam"), pairs, strict=True):
        own = [written[f"up_{name}_{key}"] for key in ("sigma_px", "chi2_multipler")]
        assert own == [number(one) for one in pair]
    assert f"features in the state: sigma {gated.state_sigma_px:.3g} px" in header
    assert f"observation gate {gated.observation_gate:.3g} x chi2(.95), in simulated windows of 60 frames" in header
    with pytest.raises(UnknownNameError, match="estimator"):
        run.sigma("nothing like it")


def test_estimators_of_one_kind_and_window_have_one_sigma(fitted_run: RunFolder) -> None:
    model = run_models(fitted_run).models["oracle"]
    found: dict[tuple[object, ...], set[float]] = {}
    for about in estimators().values():
        if about.purpose is not None:
            advice = about.advise(model)
            key = (advice.landmark, advice.purpose, advice.window, advice.kernel, about.knee)
            found.setdefault(key, set()).add(advice.sigma.value)
    assert all(len(sigmas) == 1 for sigmas in found.values())
    assert len(found) < len(estimators())
