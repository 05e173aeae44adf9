"""The conditions that the first screen and its sentences are about."""

from tracknoise.findings.headlines.reported_conditions import ReportedConditions
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.factors.factors import ReferenceCondition


def reported_conditions(data: ReportData, speed: int) -> ReportedConditions:
    """Every tracker at a speed, in the view that the report shows."""
    found = {name: data.key_frame(name) for name in data.directions}
    frames = {name: frame for name, frame in found.items() if frame is not None}
    reference = ReferenceCondition(**data.view, speed=speed, key_frames=frames)
    return ReportedConditions(
        reference,
        data.trackers,
        data.population,
        data.percentile,
        fitted=data.truth_is_fitted,
        trimming=data.trimming,
    )
