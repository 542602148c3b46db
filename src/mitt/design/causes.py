"""Why balls were not caught within every limit."""

from mitt.trials.score import Trial, reason_of

BEYOND = "beyond a limit"
"""Why a ball does not count that was caught, in :attr:`Evaluation.binding`."""
FORCE = "force"
"""And where it pressed harder than hand and arm take."""


def cause_of(trials: list[Trial]) -> str:
    """Return why balls most often were not caught within every limit; nothing where all were."""
    causes = [x for x in map(_cause, trials) if x]
    return max(sorted(set(causes)), key=causes.count) if causes else ""


def _cause(trial: Trial) -> str:
    """Return why a ball was not caught within every limit; nothing where it was.

    The limit that the verdict names is the cause only where the throw was refused for it.
    """
    match trial.status:
        case "caught":
            return BEYOND if trial.limit_violations else FORCE if trial.over_force else ""
        case "unreachable":
            return trial.binding_limit or trial.status
        case "stopped":
            why = reason_of(trial.stopped_by)
            return f"stopped: {why}" if why else trial.status
        case _:
            return trial.status
