"""The picture of the first screen says what innovations suggest and what to set, and shows the worst track."""

import re

import numpy as np
import pytest

from tracknoise.estimators.exports import estimator
from tracknoise.estimators.model import Landmark, Purpose
from tracknoise.estimators.run_models import run_models
from tracknoise.report.answer import number_of, summarise
from tracknoise.report.answer_plot import AnswerPlot, Curve, answer_plot
from tracknoise.report.report_data import ReportData
from tracknoise.topics.answer_summary import NoiseToSet


@pytest.fixture(scope="module")
def model(fitted_run):
    return run_models(fitted_run).models["oracle"]


def to_set(sigma, innovations, *, tracker="oracle", is_bound=False):
    sizes = (number_of(value, None, None) for value in (sigma, innovations))
    return NoiseToSet(tracker, "#0072B2", 11, None, next(sizes), is_bound, "", next(sizes))


@pytest.mark.parametrize(
    ("one", "title"),
    [
        (to_set(0.16, 0.069), "Your innovations suggest 0.069 px. Set 0.160 px."),
        (to_set(0.16, 0.069, is_bound=True), "Your innovations suggest 0.069 px. Sigma is at most 0.160 px."),
        (to_set(0.5, 0.49), "Your innovations are right: set 0.500 px."),
    ],
)
def test_the_title_is_the_answer(model, one, title):
    found = answer_plot({"oracle": model}, "filter", [one])
    assert found.title.replace("\N{NO-BREAK SPACE}", " ") == title


def test_it_is_about_the_tracker_that_residuals_mislead_most(model):
    settings = [to_set(0.5, 0.4, tracker="a"), to_set(0.5, 0.1, tracker="b"), to_set(0.5, 0.2, tracker="c")]
    found = answer_plot(dict.fromkeys("abc", model), "filter", settings)
    assert found.subject == "b; windows of 11 frames"
    assert found.heading.startswith("With b, innovations suggest")
    assert [curve.tracker for curve in found.curves] == ["b", "a", "c"]


@pytest.mark.parametrize("name", ["filter", "colmap", "gtsam", "xivo", "pnp"])
def test_curves_are_what_is_set_in_windows_of_each_length(fitted_run, model, name):
    data = ReportData.of(fitted_run)
    found = answer_plot({"oracle": model}, name, summarise(data).settings)
    (curve,) = found.curves
    assert curve.windows
    for window, to_set, innovations in zip(curve.windows, curve.to_set, curve.innovations, strict=True):
        assert to_set == estimator(name).advise(model, window=window).sigma.value
        expected = model.equivalent(landmark=Landmark.FREE, window=window, purpose=Purpose.INNOVATIONS)
        assert innovations == expected.sigma.value
        assert window <= model.training.ages[1] + 1


def test_the_title_is_about_the_leader_where_there_is_one(model):
    settings = [to_set(0.5, 0.1 + 0.01 * place, tracker=name) for place, name in enumerate("abcde")]
    found = answer_plot(dict.fromkeys("abcde", model), "filter", settings, "d")
    assert found.subject.startswith("d; ")
    assert len(found.curves) == 3


def test_a_sentence_says_why_where_innovations_mislead(model):
    told = [answer_plot({"oracle": model}, name, [to_set(0.16, 0.07)]).why for name in ("filter", "pnp")]
    assert "another depth" in told[0]
    assert "not fitted" in told[1]
    assert answer_plot({"oracle": model}, "filter", [to_set(0.16, 0.155)]).why == ""
    bound = answer_plot({"oracle": model}, "filter", [to_set(0.16, 0.07, is_bound=True)])
    assert "do not show" in bound.why
    assert bound.solid == "upper bound"


def test_labels_do_not_cover_each_other():
    curves = tuple(Curve(name, "#000000", 11, 0.5, (5, 10), (0.5, 0.5), (0.4, 0.4)) for name in "abcd")
    drawn = AnswerPlot("title", "subject", curves).plot()
    places = [float(y) for y in re.findall(r'<text x="4\d\d" y="([\d.]+)" fill="var\(--ink\)"', drawn)]
    assert len(places) == 4
    assert np.diff(np.sort(places)).min() > 12


def test_without_a_model_there_is_none(model):
    assert answer_plot({}, "filter", [to_set(0.5, 0.4)]) is None
    assert answer_plot({"oracle": model}, "filter", [to_set(0.0, 0.0)]) is None
