"""What multiplies the components of the noise, as exports write it in other languages: (noise_model.track)."""

from dataclasses import dataclass

from tracknoise.inference.track_noise import NAMES


@dataclass(frozen=True, slots=True)
class ComponentCode:
    """Of one component. `walked` is a sum of squared depths in C++, and what multiplies a walk in Python."""

    error: str  # C++: for an error at `age`, with the magnification m and the factor f; `later` is 1 after the birth
    change: str  # C++: for a change over a number of `frames` after the first one
    cpp: str  # C++: for frames j and k of a track, about its true positions, from the `depth` of each
    python: str  # the same for all frames, (n, n), from the `age` of each


_CODE = {
    "first": ComponentCode("later * m * m", "0.0", "1.0 * (j == 0 && k == 0)", "np.diag(age == 0)"),
    "white": ComponentCode("later * f", "2.0 * f", "1.0 * (j == k && j > 0)", "np.diag(age > 0)"),
    "walk": ComponentCode(
        "f * age * (1.0 + m + m * m) / 3.0",
        "f * frames",
        "walked[std::min(j, k)] / (depth[j] * depth[k])",
        "walked",
    ),
    "drift": ComponentCode("age * age", "frames * frames", "1.0 * j * k", "np.outer(age, age)"),
}
CODE = {name: _CODE[name] for name in NAMES}
"""By the name of the component."""
