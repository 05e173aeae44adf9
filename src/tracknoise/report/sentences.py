"""Words and numbers as the report writes them: those of the findings, and its own signs."""

from tracknoise.findings.wording import (
    DASH,
    MINUS,
    SPACE,
    TIMES,
    count,
    effect_text,
    listing,
    number,
    percent,
    pixels,
    px,
)

__all__ = [
    "DASH",
    "KAPPA",
    "MINUS",
    "MU",
    "NU",
    "SPACE",
    "TIMES",
    "count",
    "effect_text",
    "listing",
    "number",
    "percent",
    "pixels",
    "px",
]

NU, MU, KAPPA = "\N{GREEK SMALL LETTER NU}", "\N{GREEK SMALL LETTER MU}", "\N{GREEK SMALL LETTER KAPPA}"
