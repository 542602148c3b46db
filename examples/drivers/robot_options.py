"""What drivers ask of a cell and of the Python that they run in."""

from importlib.util import find_spec

from mitt.errors import InputError
from mitt.files.cell import Cell


def address_of(cell: Cell) -> str:
    """Return the address of the robot."""
    address = cell.robot.options.get("address")
    if not isinstance(address, str):
        raise InputError("robot.options.address", "the address of the robot", repr(address))
    return address


def check_library(driver: str, library: str, package: str) -> None:
    """Refuse a Python without the library of a driver, and name the package that has it."""
    if find_spec(library) is None:
        raise InputError(
            f"driver {driver!r}",
            f"the library {library}",
            "a Python without it",
            do=f"pip install {package}",
        )
