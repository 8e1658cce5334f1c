"""Who is refused a device that another program has claimed, and what the refusal says."""

from __future__ import annotations

import getpass
import socket
import subprocess
import sys

import pytest

from hapticd.errors import DeviceBusyError
from hapticd_drivers.claims import Claims

_HOLDER = """
import sys
from hapticd_drivers.claims import Claims
claims = Claims()
claims.take("moteus", "motor 1 on a test's bus")
print(flush=True)
sys.stdin.read()
"""


def test_a_refusal_says_which_process_has_the_motor_and_whose_it_is() -> None:
    """Any user can take a claim: who runs the service has to know whom to ask."""
    command = [sys.executable, "-P", "-c", _HOLDER]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as holder:
        assert holder.stdout is not None
        holder.stdout.readline()
        owner = f"process {holder.pid} of user {getpass.getuser()} "
        with pytest.raises(DeviceBusyError, match=f"moteus: {owner}.* has motor 1 on a test's bus: end it first"):
            Claims().take("moteus", "motor 1 on a test's bus")
        holder.communicate()
    claims = Claims()
    claims.take("moteus", "motor 1 on a test's bus")
    claims.release()


def test_a_name_that_no_one_answers_for_is_refused_with_how_to_find_its_owner() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as taken:  # and does not listen
        taken.bind(b"\0hapticd moteus motor 2 on a test's bus")
        with pytest.raises(DeviceBusyError, match=r"moteus: another program \(`sudo ss -xap .*has motor 2"):
            Claims().take("moteus", "motor 2 on a test's bus")
