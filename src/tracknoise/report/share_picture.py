"""``share.png``: what to set, and why, in a picture for readmes and links."""

from collections.abc import Iterator

from markupsafe import Markup

from tracknoise.report import figure_files, style
from tracknoise.report.answer_plot import AnswerPlot, shortened
from tracknoise.report.leaderboard import Leaderboard
from tracknoise.report.worst_track import Strip
from tracknoise.text import printable
from tracknoise.topics.answer_summary import Summary

FILE = "share.png"
WIDTH, HEIGHT = 1200, 630
"""Size of the file, px, as pages that show links expect it."""
_PAPER = {"ink": style.INK, "quiet": style.QUIET, "line": style.FAINT}


_MOST_RANKED = 16


def png(summary: Summary, shown: AnswerPlot | None, strip: Strip | None, board: Leaderboard | None) -> bytes | None:
    """The picture as a file of `WIDTH` times `HEIGHT` px; None where nothing is known that could be set.

    Parameters
    ----------
    summary
        Names the experiment.
    shown, strip
        Curves of some trackers, and frames of the worst track of the first.
    board
        Of many trackers: their ranks are shown in place of curves.
    """
    if board is not None:
        parts = [*_ranked(board, summary)]
    elif shown is not None:
        parts = [*_curves(shown, strip)]
    else:
        return None
    parts.append(_text(860, 594, 18, f"tracknoise: {summary.experiment}"))
    svg = Markup(
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
        'font-family="{font}" fill="{ink}"><rect width="{width}" height="{height}" fill="#ffffff"/>{parts}</svg>'
    ).format(width=WIDTH, height=HEIGHT, font=style.FONT, ink=style.INK, parts=Markup("").join(parts))
    return figure_files.png_of(str(svg), scale=1.0)


def _curves(shown: AnswerPlot, strip: Strip | None) -> Iterator[Markup]:
    """What to set by the frames in a window, a legend, and the worst track."""
    yield _text(48, 84, 44, shown.title, weight=700)
    yield _text(48, 126, 24, shown.subject)
    yield _text(860, 380, 18, f"solid: {shown.solid}")
    yield _text(860, 410, 18, "dashed: what innovations suggest")
    for place, curve in enumerate(shown.curves):
        y = 192 + 40 * place
        yield Markup('<circle cx="868" cy="{y}" r="7" fill="{colour}"/>').format(y=y, colour=curve.colour)
        yield _text(886, y + 8, 24, shortened(printable(curve.tracker), 26))
    yield _nested(shown.plot(_PAPER), x=24, y=150, scale=1.4)
    if strip is not None:
        yield _nested(strip.tiles(), x=48, y=494, scale=1.1)
        yield _text(48, 594, 18, strip.caption)


def _ranked(board: Leaderboard, summary: Summary) -> Iterator[Markup]:
    """Ranks and sigmas of the first trackers, in two columns."""
    title, _, reason = board.leader_with(summary.settings).partition(". ")
    yield _text(48, 84, 48, f"{title}.", weight=700)
    yield _text(48, 126, 24, reason)
    rows, role = board.rows[:_MOST_RANKED], board.roles[0]
    half = -(-len(rows) // 2)
    for place, row in enumerate(rows):
        x, y = 48 + 580 * (place // half), 220 + 40 * (place % half)
        if place % half == 0:
            yield from (_text(x + at, 178, 18, name) for at, name in ((0, "rank"), (130, "tracker"), (380, "sigma")))
        yield _text(x, y, 24, row.span(role))
        yield _text(x + 130, y, 24, shortened(printable(row.tracker), 18), weight=700)
        yield _text(x + 380, y, 24, f"{'at most ' if row.is_bound else ''}{row.sigma.text}")
    left = len(board.standings) - len(rows)
    yield _text(48, 594, 18, f"Ranks in {board.ranked_by}{f'; {left} more' if left else ''}")


def _text(x: float, y: float, size: int, text: str, *, weight: int = 400) -> Markup:
    """A line of text, shortened to the room that it has."""
    shown = shortened(printable(text), int(1.95 * (WIDTH - x - 20) / size))
    return Markup('<text x="{x}" y="{y}" font-size="{size}" font-weight="{weight}">{text}</text>').format(
        x=x, y=y, size=size, weight=weight, text=shown
    )


def _nested(svg: Markup, *, x: float, y: float, scale: float) -> Markup:
    """A drawing within another one, at a place."""
    return Markup('<g transform="translate({x} {y}) scale({scale})">{parts}</g>').format(
        x=x, y=y, scale=scale, parts=Markup(svg.split(">", 1)[1].removesuffix("</svg>"))
    )
