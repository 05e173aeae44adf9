"""A noise model as a C++ header, for front ends that evaluate it while they run."""

import numpy as np
from numpy.typing import NDArray

from tracknoise.estimators.exports import in_comment
from tracknoise.estimators.model import Factor
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.inference.track_noise import COMPONENTS, NAMES

_HEAD = """\
// Noise of {tracker} at speed {speed:g}, by tracknoise. Model sha256 {sha256}.
// Errors in px at {width} x {height}, focal length {focal}. Ages and the walk are per frame of the recording.
#pragma once
#include <algorithm>
#include <cmath>
namespace tracknoise {{
struct Covariance {{ double uu, uv, vv; }};  // px^2
constexpr Covariance {parts};
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
inline Covariance sum({arguments}) {{
  return {{{uu},
          {uv},
          {vv}}};
}}
// About the first position, at an age in frames, 0 at age 0; m = Z_0 / Z_k; f = product of the factors.
inline Covariance covariance(double age, double m = 1.0, double f = 1.0) {{
  const double later = age > 0.0 ? 1.0 : 0.0;
  return sum({error});
}}
inline Covariance change_covariance(double frames = 1.0, double f = 1.0) {{
  return sum({change});
}}
"""
_SIGMA = """// Of one observation: the sigma that is set for all (px), times the root of the factors. NaN is unknown.
inline double sigma(double set_px{parameters}) {{
  return set_px * std::sqrt({factors});
}}
}}  // namespace tracknoise
"""


def cpp_header(model: NoiseModel) -> str:
    """The header, C++11."""
    parts = ", ".join(f"{name}{_covariance(own)}" for name, own in zip(NAMES, model.components, strict=True))
    head = _HEAD.format(
        tracker=in_comment(model.training.tracker),
        speed=model.training.speed,
        sha256=model.sha256,
        width=model.camera.width,
        height=model.camera.height,
        focal="unknown" if model.camera.focal_px is None else f"{model.camera.focal_px:g} px",
        parts=parts,
    )
    return head + "".join(_factor(one) for one in model.conditions) + _tail() + _sigma(model)


def _tail() -> str:
    letters = {one.name: one.letter.lower() for one in COMPONENTS}
    return _TAIL.format(
        arguments=", ".join(f"double {letter}" for letter in letters.values()),
        **{
            entry: " + ".join(f"{letter} * {name}.{entry}" for name, letter in letters.items())
            for entry in ("uu", "uv", "vv")
        },
        error=", ".join(one.code.error for one in COMPONENTS),
        change=", ".join(one.code.change for one in COMPONENTS),
    )


def _sigma(model: NoiseModel) -> str:
    names = [one.of for one in model.conditions]
    parameters = "".join(f", double at_{name} = NAN" for name in names)  # a name alone may be a word of C++
    factors = " * ".join(f"factor_{name}(at_{name})" for name in names) or "1.0"
    return _SIGMA.format(parameters=parameters, factors=factors)


def _covariance(own: NDArray[np.float64]) -> str:
    (uu, uv), (_, vv) = own
    return f"{{{uu:.9g}, {uv:.9g}, {vv:.9g}}}"


def _factor(one: Factor) -> str:
    knots, logs = (", ".join(f"{value:.9g}" for value in values) for values in (one.log_knots, one.log_factor))
    return _FACTOR.format(name=one.of, knots=knots, logs=logs, n=len(one.log_knots))
