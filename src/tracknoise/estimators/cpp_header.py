"""A noise model as a C++ header, for front ends that evaluate it while they run."""

from tracknoise.estimators.exports import in_comment
from tracknoise.estimators.model import Component, Factor
from tracknoise.estimators.noise_model import NoiseModel

_HEAD = """\
// Noise of {tracker} at speed {speed:g}, by tracknoise. Model {sha256}.
// Errors in px at {width} x {height}, focal length {focal}. Ages and the walk are per frame of the recording.
#pragma once
#include <algorithm>
#include <cmath>
namespace tracknoise {{
struct Covariance {{ double uu, uv, vv; }};  // px^2
constexpr Covariance first{first}, white{white}, walk{walk}, drift{drift};
inline double factor(double value, const double* knots, const double* logs, int n) {{  // linear in log(value), clamped
  if (std::isnan(value)) return 1.0;  // unknown
  const double x = std::log(std::max(value, 1e-300));
  if (x <= knots[0]) return std::exp(logs[0]);
  for (int i = 1; i < n; ++i)
    if (x <= knots[i])
      return std::exp(logs[i - 1] + (logs[i] - logs[i - 1]) * (x - knots[i - 1]) / (knots[i] - knots[i - 1]));
  return std::exp(logs[n - 1]);
}}
"""
_FACTOR = """\
inline double factor_{name}(double value) {{
  constexpr double knots[] = {{{knots}}}, logs[] = {{{logs}}};
  return factor(value, knots, logs, {n});
}}
"""
_TAIL = """\
inline Covariance sum(double a, double w, double q, double d) {
  return {a * first.uu + w * white.uu + q * walk.uu + d * drift.uu,
          a * first.uv + w * white.uv + q * walk.uv + d * drift.uv,
          a * first.vv + w * white.vv + q * walk.vv + d * drift.vv};
}
// About the first position, at an age in frames, 0 at age 0; m = Z_0 / Z_k; f = product of the factors.
inline Covariance covariance(double age, double m = 1.0, double f = 1.0) {
  const double later = age > 0.0 ? 1.0 : 0.0;
  return sum(later * m * m, later * f, f * age * (1.0 + m + m * m) / 3.0, age * age);
}
inline Covariance change_covariance(double frames = 1.0, double f = 1.0) {
  return sum(0.0, 2.0 * f, f * frames, frames * frames);
}
"""
_SIGMA = """// Of one observation: the sigma that is set for all (px), times the root of the factors. NaN is unknown.
inline double sigma(double set_px{parameters}) {{
  return set_px * std::sqrt({factors});
}}
}}  // namespace tracknoise
"""


def cpp_header(model: NoiseModel) -> str:
    """The header, C++11."""
    parts = {name: _covariance(getattr(model, name)) for name in ("first", "white", "walk", "drift")}
    head = _HEAD.format(
        tracker=in_comment(model.training.tracker),
        speed=model.training.speed,
        sha256=model.sha256,
        width=model.camera.width,
        height=model.camera.height,
        focal="unknown" if model.camera.focal_px is None else f"{model.camera.focal_px:g} px",
        **parts,
    )
    return head + "".join(_factor(one) for one in model.conditions) + _TAIL + _sigma(model)


def _sigma(model: NoiseModel) -> str:
    names = [one.of for one in model.conditions]
    parameters = "".join(f", double {name} = NAN" for name in names)
    return _SIGMA.format(parameters=parameters, factors=" * ".join(f"factor_{name}({name})" for name in names) or "1.0")


def _covariance(part: Component) -> str:
    (uu, uv), (_, vv) = part.covariance
    return f"{{{uu:.9g}, {uv:.9g}, {vv:.9g}}}"


def _factor(one: Factor) -> str:
    knots, logs = (", ".join(f"{value:.9g}" for value in values) for values in (one.log_knots, one.log_factor))
    return _FACTOR.format(name=one.of, knots=knots, logs=logs, n=len(one.log_knots))
