"""What the first screen shows for each estimator, length of its windows, and number of features that a reader picks."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from tracknoise.estimators.advice import innovations_of
from tracknoise.estimators.equivalents import LENGTHS
from tracknoise.estimators.exports import Estimator, Target, estimators
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.exceptions import SettingsError
from tracknoise.report.answer import limit_text, number_of
from tracknoise.report.answer_plot import answer_plot
from tracknoise.report.leaderboard import Leaderboard
from tracknoise.topics.answer_summary import NoiseToSet

FEATURES = (50, 100, 200, 500)
"""Features of a frame that can be picked, beside the number that the estimator takes by default."""
_AS_SHIPPED = Target()


@dataclass(frozen=True, slots=True)
class Picker:
    """What can be picked.

    Attributes
    ----------
    models, colours
        By tracker.
    are_bounds
        Whether sigmas are upper bounds, because the truth is not trusted.
    first, target
        The estimator of the experiment, and its windows and features.
    board
        Names its leader for each estimator too; None where the run has none.
    """

    models: Mapping[str, NoiseModel]
    colours: Mapping[str, str]
    are_bounds: bool
    first: str
    target: Target
    board: Leaderboard | None

    def choices(self) -> dict[str, Any]:
        """What the script of the page reads.

        Returns: `kinds`, by estimator the key of what to set, the same for those that take noise alike; and `settings`,
        by this key a list with an entry for each number of features: `features`, `window` by default, `plot`, and
        `windows`, by their length `rows` (for each tracker sigma, its interval, what belongs to it, and innovations),
        `heading`, `why`, `key` and `leader`. Estimators without one sigma have no kind.
        """
        kinds = {name: self._kind(name, about) for name, about in estimators().items()}
        names = {kind: name for name, kind in reversed(kinds.items())}
        made = {kind: settings for kind, name in names.items() if (settings := [*self._of_features(name)])}
        keys = {kind: str(number) for number, kind in enumerate(made)}
        return {
            "kinds": {name: keys[kind] for name, kind in kinds.items() if kind in keys},
            "settings": {keys[kind]: settings for kind, settings in made.items()},
        }

    def _target(self, name: str) -> Target:
        return self.target if name == self.first else _AS_SHIPPED

    def _kind(self, name: str, about: Estimator) -> object:
        """The same for estimators with which the same is set."""
        noise = about.landmark, about.purpose, about.inertial, about.kernel, about.knee, about.gates
        target = self._target(name)
        return *noise, target.window or about.window, about.state_window, target.features

    def _of_features(self, name: str) -> Iterator[dict[str, Any]]:
        """What to set for each number of features; one entry where errors in common change nothing."""
        known: list[object] = []
        window = self._target(name).window
        for features in (self._target(name).features, *FEATURES):
            default = [*self._settings(name, window, features)]
            numbers = [(one.sigma, one.limit) for one in default]
            if default and numbers not in known:
                known.append(numbers)
                yield self._of_windows(name, default, features)

    def _of_windows(self, name: str, default: list[NoiseToSet], features: int | None) -> dict[str, Any]:
        lengths = {equivalent.window for model in self.models.values() for equivalent in model.equivalents}
        by_length = {
            window: found
            for window in lengths.intersection(LENGTHS)
            if (found := [*self._settings(name, window, features)])
        }
        by_length[default[0].window] = default
        leader = None if self.board is None else self.board.first_with(default)
        picture = answer_plot(self.models, name, default, leader)
        words: dict[int, dict[str, Any]] = {}
        for window, found in sorted(by_length.items()):
            rows = {one.tracker: [one.sigma.text, one.sigma.interval, one.limit, one.innovations.text] for one in found}
            words[window] = {"rows": rows}
            if picture is not None:
                named = next((one for one in found if one.tracker == picture.curves[0].tracker), None)
                titled = picture if named is None else picture.titled(named, name)
                words[window] |= {"heading": titled.heading, "why": titled.why, "key": titled.key}
            if self.board is not None:
                words[window]["leader"] = self.board.leader_with(found)
        return {
            "features": default[0].features,
            "window": default[0].window,
            "plot": "" if picture is None else str(picture.plot()),
            "windows": words,
        }

    def _settings(self, name: str, window: int | None, features: int | None) -> Iterator[NoiseToSet]:
        """What to set for each tracker whose model has it."""
        for tracker, model in self.models.items():
            try:
                advice = estimators()[name].advise(model, window=window, features=features)
                innovations = innovations_of(model, advice)
            except SettingsError:
                continue
            factors = {f"{gate}_gate": factor for gate, factor in advice.gates.items()}
            factors |= {} if advice.knee is None else {"knee": advice.knee}
            yield NoiseToSet(
                tracker,
                self.colours[tracker],
                advice.window,
                advice.features,
                number_of(advice.sigma.value, advice.sigma.low, advice.sigma.high),
                self.are_bounds,
                limit_text(None if advice.kernel is None else advice.kernel.value, factors, is_bound=self.are_bounds),
                number_of(innovations.value, None, None),
                1 if model.of_both is None else 2,
            )
