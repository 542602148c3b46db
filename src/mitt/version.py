"""Version of mitt, also in results, maps and studies."""

__version__ = "0.1.0"
