"""Progress lines on stderr, against what takes long and what is no command."""

import subprocess
import sys

_SCRIPT = """
import time
from jaxbiped import _progress
_progress._PATIENCE = 0.2
with _progress.stage("before anything is told"):
    time.sleep(0.4)
_progress.tell_stages()
with _progress.stage("quick"):
    pass
with _progress.stage("slow"):
    time.sleep(0.4)
"""


def test_only_what_takes_long_is_told_and_only_in_commands():
    ended = subprocess.run([sys.executable, "-c", _SCRIPT], capture_output=True, text=True)
    assert ended.returncode == 0
    assert ended.stderr == "slow …\n"
    assert ended.stdout == ""
