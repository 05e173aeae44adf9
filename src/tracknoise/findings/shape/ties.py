"""Errors that are equal to one another: on a grid, or many of them exactly zero.

Densities have no place for them: a fit that shrinks onto equal errors gains without limit. In data without a grid
errors are never equal, so that a few are enough to say so. A grid that is fine beside the spread of errors makes few
equal, and does not matter.
"""

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.wording import number, percent

Array = NDArray[np.float64]

ON_GRID = "errors lie on a grid of"
"""How the words begin that name a grid."""
MIN_EQUAL = 3
"""Fewest equal errors that count."""
MAX_SHARE, MAX_SHARE_OF_AXIS = 0.005, 0.05
"""Largest share of errors that may be equal in u and v, or in one of them."""
_WHOLE = 1e-3
"""How far from a whole number of steps a value on a grid may be, in steps."""
_FINEST = 1e-6
"""Steps that are smaller than this, relative to the largest error, are rounding."""


def ties(errors: Array) -> str | None:
    """What makes errors equal to one another, in words; None if too few are to matter.

    Parameters
    ----------
    errors : (n, 2)
        In u and v, px.
    """
    of_axis = max((_commonest(axis) for axis in errors.T), default=0.0)
    pairs = np.ascontiguousarray(errors + 0.0).view(np.complex128)  # -0.0 counts as 0.0
    share = _commonest(pairs) if of_axis else 0.0  # equal pairs are equal in u
    if share <= MAX_SHARE and of_axis <= MAX_SHARE_OF_AXIS:
        return None
    zero = float(np.mean((errors == 0).any(axis=1)))
    steps = [_step(axis) for axis in errors.T]
    grid = next((step for step in steps if step is not None), None)
    if grid is not None:
        return f"{ON_GRID} {_fraction(grid)} px: a density cannot be fitted to them"
    what = (
        f"{percent(zero)} of errors are exactly zero" if zero > share / 2 else f"{percent(share)} of errors are equal"
    )
    return f"{what}: a density cannot be fitted to them"


def _commonest(values: NDArray[np.complex128] | Array) -> float:
    """Share of the commonest value; 0 if fewer than `MIN_EQUAL` are equal."""
    ordered = np.sort(values)
    if not (ordered[1:] == ordered[:-1]).any():  # as mostly: counting takes longer than sorting
        return 0.0
    most = int(np.unique(ordered, return_counts=True)[1].max())
    return most / values.size if most >= MIN_EQUAL else 0.0


def _step(values: Array) -> float | None:
    """Step of the grid that all values are on; None if there is none."""
    places = np.unique(values)
    apart = np.diff(places)
    apart = apart[apart > _FINEST * np.abs(values).max(initial=0.0)]
    if not len(apart) or len(places) == values.size:
        return None
    step = float(apart.min())
    return step if (np.abs(places / step - np.round(places / step)) < _WHOLE).all() else None


def _fraction(step: float) -> str:
    parts = round(1 / step) if step < 1 else 0
    return f"1/{parts}" if parts and abs(parts * step - 1) < _WHOLE else number(step)
