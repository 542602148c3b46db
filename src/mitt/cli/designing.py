"""``mitt design``: find what an arm can catch and the map that does it."""

import os
import shlex
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from mitt.cli.options import DesignOptions
from mitt.cli.screen import (
    check_new_files,
    checked,
    file_beside,
    print_json,
    progress,
    say,
    show,
    table,
    tell_of_kernels,
    warn,
)
from mitt.core.arm.arm import Arm
from mitt.core.arm.basket import MOST_TILT
from mitt.core.arm.shapes import check_floor
from mitt.core.errors import InputError, MittError, UnknownNameError
from mitt.interrupts import finally_do, notice, status_of, tell, words_of
from mitt.io.arm_file import (
    ArmFile,
    design_of,
    hand_of,
    is_arm_file,
    with_notes_logged,
    write_arm_file,
)
from mitt.io.load import arm_names
from mitt.io.reading import MAX_TOML_BYTES, read_text, reals_of
from mitt.io.writing import check_own
from mitt.lab.design.arm_design import Design, best_so_far, default_balls, release_speed
from mitt.lab.design.arm_design import design as search_design
from mitt.lab.design.candidate import candidate_of
from mitt.lab.design.driven_arm import held_as, whole_arm
from mitt.lab.design.evaluation import ENOUGH
from mitt.lab.design.search import effort_of, search_of
from mitt.lab.design.search_jobs import Answers
from mitt.lab.design.task import AROUND_FLIGHTS, DesignTask, box_of, of_flights, of_throws, seen
from mitt.lab.trials.workers import check_engine, engine_of
from mitt.lab.world.flights import read_flights
from mitt.lab.world.scene import DEFAULT_SCENE, Scene, read_scene
from mitt.lab.world.throws import read_throws

#: Options that say nothing of the design.
_ELSEWHERE = ("arm", "out", "workers", "resume", "overwrite", "json", "check")
#: How the file of a search begins that was broken off.
_BROKEN_OFF = "mitt design: broken off"


def design_command(options: DesignOptions) -> int:
    """Run ``mitt design``; return its exit status."""
    file = _given(options)
    origin = arm_origin(options, file)
    hand = hand_of(origin.hand, origin.hand_tilt, origin.hand_force, origin.hand_depth)
    whole = whole_arm(
        origin.arm,
        tip=origin.tip,
        limits=origin.limits,
        hand=hand,
        mount=origin.hand_mount,
        joints=_named(options),
    )
    with_notes_logged(whole, options.arm)
    joints = _joints(options, whole)
    start = None if file is None or options.effort != "refine" else candidate_of(whole, file)
    if file is not None and joints is None and is_arm_file(options.arm):
        whole, joints = _as_in(file, whole)
    scene = read_scene(options.scene or DEFAULT_SCENE, flights=options.flights is not None)
    check_floor(whole.model, scene.floor)
    task = _task(options, whole, scene)
    rate = _rate(options)
    check_engine("local", options.workers)
    _check_outputs(options)
    effort = effort_of(options.effort, whole.n if joints is None else len(joints))
    search = search_of(whole, task, effort, joints=joints, rate=rate, start=start)
    if options.check:
        return checked(f"{whole.model.name}, {whole.n} joints, output to {options.out}")
    tell_of_kernels()
    engine = None if options.workers == 1 else engine_of("local", options.workers)
    answers = Answers.open(_search(options), search, resume=options.resume)

    def last_words() -> str:
        return _keep(best_so_far(whole, answers, rate), origin, options)

    try:
        with finally_do(last_words), progress() as report:
            found = search_design(
                whole,
                task,
                effort,
                progress=report,
                joints=joints,
                engine=engine,
                rate=rate,
                answers=answers,
                start=start,
            )
    except KeyboardInterrupt as stop:
        notice()
        tell(f"{words_of(status_of(stop))}; {last_words()}")
        return status_of(stop)
    except MittError as error:
        raise MittError(f"{error}; {last_words()}") from None
    else:
        _finish(found, origin, scene, options)
        answers.close(done=True)
        return 0
    finally:
        if engine is not None:
            engine.close(at_once=True)
        answers.close(done=False)


def _finish(found: Design, origin: ArmFile, scene: Scene, options: DesignOptions) -> None:
    """Write arm file and page of a search that is over, and print what was found."""
    page = file_beside(options.out, ".html")
    if found.usable:
        write_arm_file(
            options.out,
            found.arm_file(origin),
            comment=_comment(found, options.scene or DEFAULT_SCENE),
        )
    written = [options.out, page] if found.usable else [page]
    _write_page(page, found, scene, _words(options))
    warn(found.left_out, json=options.json)
    if options.json:
        say(f"written: {', '.join(str(path) for path in written)}")
        print_json(found.as_json())
    else:
        _show(found, options.out, written)
        if found.usable:
            seen = [] if options.scene is None else ["--scene", str(options.scene)]
            show(f"next: {shlex.join(['mitt', 'catch', '--arm', str(options.out), *seen])}")


def _keep(best: Design | None, origin: ArmFile, options: DesignOptions) -> str:
    """Write the best design of a search that is broken off; return in words what is kept.

    An earlier design stays: only what another search wrote that was broken off is replaced.
    """
    go_on = "--resume goes on with the search"
    if best is None:
        return f"no design catches enough yet; {go_on}"
    assert best.best is not None
    if options.out.exists() and not read_text(options.out, max_bytes=MAX_TOML_BYTES).startswith(
        f"# {_BROKEN_OFF}"
    ):
        return f"the earlier design in {options.out} stays; {go_on}"
    caught = f"{best.best.clean} of {best.best.thrown}"
    write_arm_file(
        options.out,
        best.arm_file(origin),
        comment=(
            f"{_BROKEN_OFF}, the best so far. Within every limit it caught {caught} of the\n"
            "throws of the search."
        ),
    )
    return f"the best so far, {caught} caught, is in {options.out}; {go_on}"


def _task(options: DesignOptions, whole: Arm, scene: Scene) -> DesignTask:
    """Return what is to be caught: default throws, a user's throws, or recorded flights."""
    if options.throws_file is not None and options.flights is not None:
        raise InputError("--throws-file and --flights", "one of them", "both")
    aim, seed, drag = _aim(options), options.seed, scene.ball.drag
    reach = float(sum(np.linalg.norm(link.placement[:3, 3]) for link in whole.model.links[1:]))
    if options.flights is not None:
        recordings = read_flights(options.flights)
        arrivals, box = of_flights(seen(recordings)), None
        if aim is not None:
            box = np.array([aim, AROUND_FLIGHTS])
        balls = arrivals.balls(aim=box, around=AROUND_FLIGHTS)
        return DesignTask(
            balls=balls, scene=scene, seed=seed, arrivals=arrivals.ranges(), recordings=recordings
        )
    if options.throws_file is not None:
        throws = read_throws(options.throws_file)
        box = box_of(seen(throws), drag, None if aim is None else np.array(aim), 0.75 * reach)
        of_throws(throws, float(box[0, 0]), drag)  # refuses one that does not pass there
        arrivals = of_throws(seen(throws), float(box[0, 0]), drag)
        return DesignTask(
            balls=arrivals.balls(aim=box),
            scene=scene,
            seed=seed,
            arrivals=arrivals.ranges(),
            throws=throws,
        )
    return DesignTask(balls=default_balls(aim, reach), scene=scene, seed=seed)


def _search(options: DesignOptions) -> Path:
    """Return where the answers of a search are kept until it is over, beside the arm file."""
    return file_beside(options.out, ".search.jsonl")


def _check_outputs(options: DesignOptions) -> None:
    """Refuse an arm file, a page or answers of a search that may not be written."""
    if options.out.suffix != ".toml":
        raise InputError("--out", "a name that ends in .toml", options.out)
    if is_arm_file(options.arm) and options.out.resolve() == Path(options.arm).resolve():
        raise InputError("--out", "another file than the arm's", options.out)
    if options.resume and options.overwrite:
        raise InputError("--resume and --overwrite", "one of them", "both")
    answers = _search(options)
    check_own("answers beside --out", answers)
    if os.path.lexists(answers) and not (options.resume or options.overwrite or options.check):
        raise InputError(
            "--out",
            "a design that is not begun",
            f"{answers}, of a search that was broken off or still runs",
            do="say --resume to go on with it, or --overwrite",
        )
    files = {"--out": options.out, "page of --out": file_beside(options.out, ".html")}
    replaced = options.overwrite or (options.resume and answers.exists())
    check_new_files(options, files, overwrite=replaced)


def _words(options: DesignOptions) -> str:
    """Return the command that makes the same design, without what does not change it."""
    said = ["design", options.arm, "--out", str(options.out)]
    for field in fields(options):
        value = getattr(options, field.name)
        if field.name not in _ELSEWHERE and value != field.default:
            said += [f"--{field.name.replace('_', '-')}", str(value)]
    return shlex.join(said)


def _write_page(path: Path, found: Design, scene: Scene, command: str) -> None:
    """Write the page beside the arm file; plots are loaded only now."""
    from mitt.lab.report.design_page import write_design_page  # noqa: PLC0415

    write_design_page(path, found, scene, command=command)


def _given(options: DesignOptions) -> ArmFile | None:
    """Return the arm file that is given as the arm, held to the description it was made for.

    To be refined, a name stands for the file of the design that ships.
    """
    refines = options.effort == "refine"
    file = design_of(options.arm) if refines or is_arm_file(options.arm) else None
    if refines and (file is None or options.joints or options.aim):
        raise InputError(
            "--effort refine",
            "an arm with a design, without --joints and --aim",
            options.arm,
            do="say --effort full",
        )
    if file is None:
        return None
    if file.hand == "none" and options.hand is None:
        raise InputError(
            options.arm,
            "an arm with a hand",
            'hand = "none"',
            do="say --hand three-finger or basket",
        )
    file.load()  # holds it to its digest
    return file


def _as_in(file: ArmFile, whole: Arm) -> tuple[Arm, list[str] | None]:
    """Return an arm with the held joints of an arm file where they are, and its active joints."""
    arm = file.load()
    held = {x.name: x.held for x in arm.model.links if x.held is not None}
    return held_as(whole, {k: x for k, x in held.items() if k in whole.names}), list(arm.names)


def arm_origin(options: DesignOptions, file: ArmFile | None) -> ArmFile:
    """Return where the arm comes from, and its hand: a name, a description, or an arm file's.

    Raises:
        InputError: The hand cannot be tilted so.
    """
    limits = options.limits
    limits_file = Path(limits) if limits is not None and limits.endswith(".toml") else limits
    if file is None:
        origin = ArmFile(
            arm=options.arm if options.arm in arm_names() else Path(options.arm),
            tip=options.tip,
            limits=limits_file,
            hand=options.hand or "three-finger",
            hand_mount=options.mount or "plate",
            hand_tilt=options.tilt or 0.0,
        )
    else:
        hand = options.hand or file.hand
        own_tilt = file.hand_tilt if hand == "basket" else 0.0
        origin = replace(
            file,
            tip=options.tip or file.tip,
            limits=limits_file or file.limits,
            hand=hand,
            hand_mount=options.mount or file.hand_mount,
            hand_tilt=own_tilt if options.tilt is None else options.tilt,
            hand_force=file.hand_force if hand == file.hand else None,
            hand_depth=file.hand_depth if hand == file.hand else None,
        )
    if origin.hand_tilt and origin.hand != "basket":
        raise InputError("--tilt", "--hand basket", origin.hand)
    if not abs(origin.hand_tilt) <= MOST_TILT:
        raise InputError("--tilt", f"an angle in -{MOST_TILT:g}..{MOST_TILT:g}", origin.hand_tilt)
    return origin


def _named(options: DesignOptions) -> list[str]:
    """Return the names that ``--joints`` gives; none where it is left out."""
    return [] if options.joints is None else [x.strip() for x in options.joints.split(",")]


def _joints(options: DesignOptions, whole: Arm) -> list[str] | None:
    """Return the joints of which three are to be active; any where none are named."""
    names = _named(options)
    if options.joints is None:
        return None
    for name in names:
        if name not in whole.names:
            raise UnknownNameError("joint", name, whole.names)
    if len(set(names)) < 3:
        raise InputError("--joints", "three different joints or more", options.joints)
    return names


def _aim(options: DesignOptions) -> list[float] | None:
    """Return the point that balls are aimed at [m]; None where the design chooses."""
    return None if options.aim is None else list(reals_of("--aim", options.aim, 3, most=100.0))


def _rate(options: DesignOptions) -> float:
    """Return the share of the throws that is asked for."""
    if not ENOUGH <= options.rate <= 1.0:
        raise InputError("--rate", f"a share from {ENOUGH:g} to 1", options.rate)
    return options.rate


def _comment(found: Design, scene: str) -> str:
    """Return what stands at the top of the file."""
    best = found.best
    assert best is not None
    text = (
        f"mitt design: within every limit caught {found.rate} of\n"
        f"{found.task.reported} (scene {scene}), relative speed {best.speed:.2f} m/s, force"
        f" {best.force:.0f} N (medians)"
    )
    if not found.found:
        text += (
            f"\nfor slower throws, leaving at {release_speed(found.task):.1f} m/s: no design"
            " catches enough of the default throws."
        )
    return text


def _taken(found: Design) -> str:
    """Return in words what force hand and arm take; nothing where that is not known."""
    force = found.whole.force
    return f", of {force:.0f} N that hand and arm take" if np.isfinite(force) else ""


def _show(found: Design, out: Path, written: Sequence[Path]) -> None:
    """Print what was found."""
    if found.rows:
        rows = table(
            "caught within every limit, by the speed of the throws",
            ("m/s", "caught", "of", "force [N]", "why not"),
            left=("why not",),
        )
        for row in found.rows:
            force = "" if row.force_n is None else f"{row.force_n:.0f}"
            rows.add_row(
                f"{row.speed_m_s:g}",
                str(row.feasible),
                str(row.throws),
                force,
                row.binding_limit or "",
            )
        show(rows)
    best, name = found.best, found.whole.model.name
    if best is not None and found.usable:
        what = "" if found.found else f" of throws at {release_speed(found.task):.1f} m/s"
        show(
            f"{name}, joints {', '.join(found.joints)}: caught within every limit"
            f" {found.rate}{what}, relative speed {best.speed:.2f} m/s, force {best.force:.0f} N"
            f" (medians){_taken(found)}; fastest throws: {found.fastest}; {found.seconds:.0f} s"
        )
    if not found.found:
        show(f"{name}: no design for the throws asked for; {found.reason}; {found.seconds:.0f} s")
    if not found.usable and out.exists():
        show(f"the earlier design in {out} stays")
    show(f"written: {', '.join(str(path) for path in written)}")
