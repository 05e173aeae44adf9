"""Parts of a noise model in other px."""

from dataclasses import replace

from tracknoise.noise_models.model import Component, Equivalent, Interval


def scaled_component(component: Component, scale: float) -> Component:
    """A component whose standard deviations are larger by a factor."""
    sigma = scaled_interval(component.sigma, scale)
    return replace(component, covariance=component.covariance * scale**2, sigma=sigma)


def scaled_equivalent(equivalent: Equivalent, scale: float) -> Equivalent:
    """A sigma that is larger by a factor. Gates are ratios, and stay."""
    return replace(equivalent, sigma=scaled_interval(equivalent.sigma, scale))


def scaled_interval(interval: Interval, scale: float) -> Interval:
    """An interval times a factor, with its bounds."""
    low, high = (None if bound is None else bound * scale for bound in (interval.low, interval.high))
    return Interval(value=interval.value * scale, low=low, high=high)
