"""The words, numbers and tables of the report."""

from collections.abc import Sequence
from html import escape
from typing import Any

from mitt.robot.arm import Arm
from mitt.study import page
from mitt.study.comparison import table_1
from mitt.study.digest import FAILURES, Digest, Spread, digest
from mitt.study.figures.learning import feedback_share
from mitt.study.figures.style import STATUS
from mitt.study.log import TrialLog
from mitt.study.score import reason_of
from mitt.study.trial import Outcome

#: Rows of a table that are shown at most.
_MOST = 500
_HEAD = ("throw", "status", "binding limit", "stopped by", "position error [mm]",
         "velocity error [m/s]", "contact force [N]", "beyond a limit [ms]")  # fmt: skip
_NONE, _TO = "\u2013", "\u2013"


def headline(short: Digest) -> str:
    """Return the outcome in five words."""
    balls = "ball" if short.throws == 1 else "balls"
    return f"{short.counts['caught']} of {short.throws} {balls} caught"


def settings(result: dict[str, Any]) -> str:
    """Return the settings of the run as a line of HTML."""
    names = ("arm", "limits", "generator", "vision", "seed")
    items = (f"{name} <b>{escape(str(result[name]))}</b>" for name in names)
    return f'<p class="settings">{" &middot; ".join(items)}</p>'


def story(short: Digest, direct: Outcome | None, plain: Outcome | None) -> str:
    """Return in sentences what happened."""
    counts = short.counts
    said = {
        "dropped": "it dropped",
        "missed": "it missed",
        "unreachable": "it refused before moving",
        "stopped": "ended in a stop",
        "aborted": "ended with physics that diverged",
    }
    rest = [f"{counts[s]} {said[s]}" for s in said if counts[s]]
    tail = f"; {', '.join(rest)}" if rest else ""
    low, high = short.ci95
    first = (
        f"{short.throws} {'ball was' if short.throws == 1 else 'balls were'} thrown at the arm. "
        f"It caught {counts['caught']}{tail}. Judged by this number of throws, the catch rate "
        f"lies between {100 * low:.1f} and {100 * high:.1f} % (95 % confidence)."
    )
    return "".join(
        f'<p class="{kind}">{escape(text)}</p>'
        for kind, text in (
            ("lead", first),
            ("", _touch(short)),
            ("", _limits(short)),
            ("", _pair(direct, plain)),
        )
        if text
    )


def _touch(short: Digest) -> str:
    """Say how well ball and hand met."""
    if short.position_mm is None or short.velocity_m_s is None:
        return "No ball touched the hand."
    return (
        f"When a ball first touched the hand, its centre was {short.position_mm.median:.1f} mm "
        f"from the catch point and {short.velocity_m_s.median:.2f} m/s off the hand's own velocity "
        f"(medians; 95 % of the throws stayed below {short.position_mm.p95:.1f} mm and "
        f"{short.velocity_m_s.p95:.2f} m/s)."
    )


def _limits(short: Digest) -> str:
    """Say whether the limits held."""
    if not short.violations:
        return "No limit of torque, speed or range was exceeded in any millisecond of any throw."
    return (
        f"In {short.violating_throws} of {short.throws} throws a limit was exceeded, or the arm "
        f"touched itself or the floor, in some milliseconds ({short.violations} in all)."
    )


def _pair(direct: Outcome | None, plain: Outcome | None) -> str:
    """Say what learning changes, on the throw that is shown."""
    if direct is None or plain is None or direct.log is None or plain.log is None:
        return ""
    saturated = plain.trial.saturated_ticks
    return (
        f"The throw that the figures show was {direct.trial.status} with the learned map, its "
        f"demand cost {direct.trial.demand_cost:.2f}; with alpha = 0 the same throw was "
        f"{plain.trial.status} at a cost of {plain.trial.demand_cost:.2f}, with a torque limit met "
        f"in {saturated} ms (learned: {direct.trial.saturated_ticks} ms) and joint angles asked "
        f"for up to {plain.trial.range_excess_rad:.2f} rad out of range. Feedback made up "
        f"{100 * feedback_share(direct.log):.0f} % of the torque instead of "
        f"{100 * feedback_share(plain.log):.0f} %."
    )


def cards(short: Digest) -> str:
    """Return the headline numbers."""
    low, high = short.ci95
    tick = short.tick_us
    out = [
        page.card("Catch rate", f"{100 * short.rate:.1f}", unit="%",
                  note=f"95 % interval {100 * low:.1f} to {100 * high:.1f} % (Wilson)"),
        page.card("Caught", f"{short.counts['caught']}", unit=f"of {short.throws} throws",
                  note=", ".join(f"{short.counts[s]} {s}" for s in FAILURES)),
        _spread_card("Position error at first contact", short.position_mm, "mm", 1),
        _spread_card("Velocity error at first contact", short.velocity_m_s, "m/s", 2),
        _spread_card("Peak contact force", short.force_n, "N", 0),
        page.card("Catcher's tick", f"{tick['p50']:.0f}", unit="\u00b5s, median",
                  note=f"99 % {tick['p99']:.0f}, 99.9 % {tick['p99_9']:.0f}, "
                       f"max {tick['max']:.0f} \u00b5s; {short.deadline_misses} beyond 1 ms"),
        page.card("Beyond a limit", f"{short.violating_throws}", unit=f"of {short.throws} throws",
                  note=f"{short.violations} ms in all"),
        _spread_card("Demand cost, eq. (22)", short.cost, "", 2),
    ]  # fmt: skip
    return f'<div class="cards">{"".join(out)}</div>{_bar(short)}'


def _spread_card(title: str, spread: Spread | None, unit: str, digits: int) -> str:
    """Return the card of a figure with its median, 95th percentile and maximum."""
    if spread is None:
        return page.card(title, _NONE)
    note = f"median; 95 % below {spread.p95:.{digits}f}, largest {spread.most:.{digits}f}"
    return page.card(title, f"{spread.median:.{digits}f}", unit=unit, note=note)


def _bar(short: Digest) -> str:
    """Return a bar of what became of the throws, and its key."""
    shares = [(s, n) for s, n in short.counts.items() if n]
    bar = "".join(f'<i style="flex:{n};background:{STATUS[s][0]}"></i>' for s, n in shares)
    key = "".join(f'<li><i style="background:{STATUS[s][0]}"></i>{n} {s}</li>' for s, n in shares)
    return f'<div class="shares">{bar}</div><ul class="key">{key}</ul>'


def failures(result: dict[str, Any]) -> str:
    """Return the table of the throws that failed, with the reason."""
    failed = [t for t in result["trials"] if t["status"] != "caught"]
    if not failed:
        return "<p>None.</p>"
    note = (
        "<p>The binding limit is the one of which the throw asked most, by the verdict before the "
        "arm moved; <code>domain</code> and <code>time</code> mean that the map has no value for "
        "the flight, or that no verdict came in time. A throw that was stopped has the reason, and "
        "the joint whose encoder it was; <code>result.json</code> says what the catcher believed, "
        "read and commanded then.</p>"
    )
    return note + page.table(_HEAD, _rows(failed), numbers=4) + _cut(failed)


def every_trial(result: dict[str, Any]) -> str:
    """Return the folded table of all throws."""
    trials = result["trials"]
    return (
        f"<details><summary>Show all {len(trials)} throws</summary>"
        f"{page.table(_HEAD, _rows(trials), numbers=4)}{_cut(trials)}</details>"
    )


def _rows(trials: Sequence[dict[str, Any]]) -> list[list[str]]:
    """Return a row a trial."""
    return [
        [
            str(t["index"]),
            str(t["status"]),
            str(t["binding_limit"] or _NONE),
            reason_of(t.get("stopped_by")) or _NONE,
            _number(t["position_error_mm"], 1),
            _number(t["velocity_error_m_s"], 2),
            _number(t["peak_contact_force_n"], 0),
            str(t["limit_violations"]),
        ]
        for t in trials[:_MOST]
    ]


def _cut(trials: Sequence[dict[str, Any]]) -> str:
    """Say that a table was cut."""
    if len(trials) <= _MOST:
        return ""
    return f"<p>The first {_MOST} of {len(trials)}; all are in <code>result.json</code>.</p>"


def _number(value: float | None, digits: int) -> str:
    """Return a number, or a dash where there is none."""
    return _NONE if value is None else f"{value:.{digits}f}"


def comparison(result: dict[str, Any], rivals: Sequence[dict[str, Any]]) -> str:
    """Return the table of this run beside others; nothing where there are none."""
    if not rivals:
        return ""
    head = ("generator", "limits", "caught", "rate [%]", "95 % interval [%]", "position [mm]",
            "velocity [m/s]", "demand cost", "beyond a limit [throws]")  # fmt: skip
    rows = []
    for other in (result, *rivals):
        d = digest(other)
        medians = [None if s is None else s.median for s in (d.position_mm, d.velocity_m_s, d.cost)]
        rows.append([
            str(other["generator"]), str(other["limits"]), f"{d.counts['caught']} of {d.throws}",
            f"{100 * d.rate:.1f}", f"{100 * d.ci95[0]:.1f}{_TO}{100 * d.ci95[1]:.1f}",
            _number(medians[0], 1), _number(medians[1], 2), _number(medians[2], 3),
            str(d.violating_throws),
        ])  # fmt: skip
    note = "<p>Medians over the throws; the first row is this run.</p>"
    return note + page.table(head, rows, numbers=7)


def specification(arm: Arm, log: TrialLog | None, vision: str) -> str:
    """Return Table 1 of the paper beside ours."""
    rows = [(r.part, r.what, r.paper, r.ours) for r in table_1(arm, log, vision=vision)]
    note = (
        "<p>What this arm reached is measured on the throw shown, up to the catch (acceleration "
        "as the mean over 5 ms); its force is what joint torques leave beyond gravity in the ready "
        "pose. Matching the ball&rsquo;s velocity takes more than the paper&rsquo;s 30 m/s&sup2;: "
        "the hand rounds the elbow at the ball&rsquo;s own speed.</p>"
    )
    return note + page.table(("part", "property", "paper", "here"), rows)
