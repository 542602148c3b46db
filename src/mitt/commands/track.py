"""``mitt track``: the ball filter alone, on recorded positions."""

import mitt
from mitt.ball.filter import MAX_HORIZON
from mitt.commands.camera_options import TrackOptions
from mitt.commands.screen import check_new_files, checked, print_json, show, warn
from mitt.errors import InputError
from mitt.tracks.filtering import follow_all, read_positions, write_track
from mitt.world.fall import WANTED, doubt_of

#: Largest standard deviation of a coordinate that makes sense [m].
_MAX_SIGMA = 1.0


def run(options: TrackOptions) -> int:
    """Run ``mitt track``; return its exit status."""
    ahead, sigma = options.ahead, options.sigma
    if ahead is not None and not 0.0 <= ahead <= MAX_HORIZON:
        raise InputError("--ahead", f"a time from 0 to {MAX_HORIZON:g} s", ahead)
    if sigma is not None and not 0.0 < sigma <= _MAX_SIGMA:
        raise InputError("--sigma", f"a length above 0, up to {_MAX_SIGMA:g} m", sigma)
    check_new_files(options, {"--out": options.out})
    positions = read_positions(options.points)
    rows, flights = len(positions.samples), len(positions.rows)
    doubt = doubt_of([(x[:, 0], x[:, 1:]) for x in map(positions.flight, positions.rows)])
    warnings = [] if doubt is None else [f"wanted {WANTED}, got {doubt.given}; {doubt.do}"]
    warn(warnings, json=options.json)
    if options.check:
        return checked(f"{rows} rows, {flights} flights, output to {options.out}")
    track = follow_all(positions.samples, positions.rows.values(), ahead=ahead or 0.0, sigma=sigma)
    write_track(options.out, positions, track, ahead=ahead is not None)
    if options.json:
        print_json({
            "schema": "mitt.track/1",
            "version": mitt.__version__,
            "rows": rows,
            "flights": flights,
            "ahead_s": ahead,
            "sigma_m": sigma,
            "warnings": warnings,
            "out": str(options.out),
        })  # fmt: skip
    else:
        show(f"{rows} rows, {flights} flights; written: {options.out}")
    return 0
