"""What a fault between sensors and catcher may change."""

from mitt.signals import Array, Senses


class SensorFault:
    """Passes everything on unchanged."""

    def exposes(self, t: float) -> bool:  # noqa: ARG002
        """Say whether the cameras expose at a tick [s]."""
        return True

    def shown(self, t: float, r_o: Array) -> Array:  # noqa: ARG002
        """Return where the exposure at a tick shows the ball [m], shape (3,)."""
        return r_o

    def delivered(self, senses: Senses) -> Senses:
        """Return what goes on to the catcher."""
        return senses
