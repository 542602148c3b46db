"""Cyclone DDS as ``mitt run`` uses it beside Fast DDS in C++, where its Debian packages are."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "ros2_interop.py"
PACKAGES = "libfastrtps-dev fastddsgen default-jre-headless g++"
HEADER = "#include <fastdds/dds/domain/DomainParticipantFactory.hpp>\n"


def missing() -> str:
    """Return what is not installed; nothing if all is."""
    tools = [name for name in ("fastddsgen", "java", "g++") if shutil.which(name) is None]
    if tools:
        return ", ".join(tools)
    words = ["g++", "-x", "c++", "-E", "-o", "/dev/null", "-"]
    found = subprocess.run(words, input=HEADER, capture_output=True, text=True, check=False)
    return "" if found.returncode == 0 else "the headers of Fast DDS"


@pytest.mark.slow
def test_no_message_is_lost_or_changed_beside_fast_dds() -> None:
    """Three seconds of joint states at 1 kHz one way, an answer to each the other way."""
    pytest.importorskip("cyclonedds")
    if lacks := missing():
        pytest.skip(f"{lacks} not found: apt-get install {PACKAGES}")
    done = subprocess.run(
        [sys.executable, str(SCRIPT), "--seconds", "3"],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    found = json.loads(done.stdout)
    assert found["sent"] == found["received"] == found["answered"] == 3000
    assert found["wrong"] == found["answers_wrong"] == 0
