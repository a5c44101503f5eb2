"""The connection to a controller: requests, answers, events. docs/controller.md has the protocol."""

from __future__ import annotations

import json
import os
import socket
import stat
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Deque, Dict, Iterable, List, Optional, Type, Union

PROTOCOL = 2
"""The protocol that is spoken here."""

Json = Dict[str, Any]


class Refused(Exception):
    """The controller refuses a request."""

    def __init__(self, request: str, why: str, state: Optional[str]) -> None:
        super().__init__(f"{request}: {why}")
        self.request = request
        """What was asked for."""
        self.why = why
        """The controller's words."""
        self.state = state
        """What the machine did, as in ``ready`` or ``fault``."""


class Gone(ConnectionError):
    """The controller is gone: what the machine does is not known here."""


@dataclass(frozen=True)
class Job:
    """What became of a program, of lines by hand, of a jog or of a homing."""

    kind: str
    """``program``, ``mdi``, ``jog`` or ``home``."""
    name: str
    outcome: str
    """``done``, ``aborted``, ``emergency-stop`` or ``fault``."""
    fault: Optional[str]
    position: Json
    """Where the machine stands: ``x_mm``, ``a_deg`` …"""
    summary: Json
    """The job as numbers, with the keys of ``tandem run --summary``."""

    @property
    def is_done(self) -> bool:
        """Whether it came to its end."""
        return self.outcome == "done"


def find_controller() -> Path:
    """The socket of the only controller of this user, or of root, that answers here.

    Raises FileNotFoundError where there is none, or more than one.
    """
    named = (os.environ.get(name, "") for name in ("RUNTIME_DIRECTORY", "XDG_RUNTIME_DIR"))
    folders = [Path(folder) for folder in named if folder.startswith("/")] or [Path("/tmp")]
    found: List[Path] = []
    for folder in [*folders, Path("/run/tandem")]:
        for path in sorted(folder.glob("tandem-*.socket")) if folder.is_dir() else []:
            data = path.lstat()
            if stat.S_ISSOCK(data.st_mode) and data.st_uid in (0, os.getuid()) and _answers(path):
                found.append(path)
    if len(found) != 1:
        shown = ", ".join(map(str, found)) or "none"
        raise FileNotFoundError(f"one controller is looked for; there is {shown}: tandem serve starts one")
    return found[0]


def _answers(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX) as tried:
        return tried.connect_ex(str(path)) == 0


class Client:
    """A client of a controller, at a unix socket or over TCP on this computer.

    Requests that move the machine take the control lease first; ``close`` and the end of a ``with`` give it back. A client
    belongs to one thread.
    """

    def __init__(
        self,
        path: Union[str, Path, None] = None,
        *,
        address: Optional[tuple[str, int]] = None,
        token: Optional[str] = None,
        timeout_s: float = 60.0,
    ) -> None:
        """Connects to the socket ``path``, to the TCP ``address`` with its ``token``, or to the only controller there is.

        ``timeout_s`` is how long an answer may take; a job may take as long as it takes.
        """
        if address is not None:
            self._socket = socket.create_connection(address)
        else:
            self._socket = socket.socket(socket.AF_UNIX)
            self._socket.connect(str(path if path is not None else find_controller()))
        self.timeout_s = timeout_s
        self._bytes = b""
        self._last_id = 0
        self._has_control = False
        self._events: Deque[Json] = deque()
        if token is not None:
            self._send({"id": 0, "request": "token", "token": token})
        greeting = self._receive(timeout_s)
        if greeting is None or "tandem" not in greeting:
            raise Gone(f"nobody there speaks protocol {PROTOCOL}: {greeting}")
        self.greeting: Json = greeting["tandem"]
        """Version, machine and state, as the controller told them first."""
        if self.greeting.get("protocol") != PROTOCOL:
            raise Gone(f"the controller speaks protocol {self.greeting.get('protocol')}, not {PROTOCOL}")

    def __enter__(self) -> Client:
        return self

    def __exit__(
        self,
        kind: Optional[Type[BaseException]],
        error: Optional[BaseException],
        trace: Optional[TracebackType],
    ) -> None:
        self.close()

    def close(self) -> None:
        """Gives the control lease back and ends the connection. What is driven is driven on."""
        try:
            if self._has_control:
                self.release_control()
        except (Refused, Gone):
            # Another client has it, or there is nobody any more.
            pass
        finally:
            self._socket.close()

    # Requests and events

    def request(self, request: str, **words: Any) -> Json:
        """Sends any request of the protocol, and waits for its answer. Raises ``Refused``."""
        self._last_id += 1
        number = self._last_id
        self._send({"id": number, "request": request, **words})
        until = time.monotonic() + self.timeout_s
        while True:
            told = self._receive(until - time.monotonic())
            if told is None:
                raise Gone(f"{request} has no answer within {self.timeout_s} s")
            if "event" in told or told.get("id") != number:
                self._events.append(told)
            elif "error" in told:
                error = told["error"]
                raise Refused(request, error.get("why", ""), error.get("state"))
            else:
                answer: Json = told.get("ok", {})
                return answer

    def event(self, timeout_s: Optional[float] = None) -> Optional[Json]:
        """The next event; ``None`` where none comes within ``timeout_s``."""
        return self._events.popleft() if self._events else self._receive(timeout_s)

    def take_control(self, over: bool = False) -> None:
        """Takes the control lease; ``over``: also from a client that holds it."""
        self.request("lease", how="take-over" if over else "take")
        self._has_control = True

    def release_control(self) -> None:
        """Gives the control lease back."""
        self._has_control = False
        self.request("lease", how="release")

    def command(self, request: str, **words: Any) -> Json:
        """A request that needs the control lease, which is taken where this client has not got it."""
        if not self._has_control:
            self.take_control()
        return self.request(request, **words)

    # Looking

    def status(self) -> Json:
        """Everything that can be seen of the machine."""
        return self.request("status")

    def wait_for_state(self, *states: str) -> Json:
        """Waits until the machine is in one of ``states``; its status."""
        while True:
            status = self.status()
            if status["state"] in states:
                return status
            time.sleep(0.02)

    def wait_for_rest(self) -> Json:
        """Waits until all axes stand, as some time behind a ``hold``; the status."""
        while True:
            status = self.status()
            if status["at_rest"]:
                return status
            time.sleep(0.02)

    def captured(self) -> List[List[float]]:
        """The rows of the capture that this client has armed with the request ``capture``; it is done.

        A row has the signals in the order in which they were asked for, and there is one for every fine period.
        """
        rows: List[List[float]] = []
        while True:
            more = self.request("captured", **{"from": len(rows)})["rows"]
            if not more:
                return rows
            rows += more

    # Work

    def mdi(self, *lines: str) -> Job:
        """Drives lines by hand, one planned through after the other, and waits for the rest.

        Raises ``Refused`` for the first that is refused; those before it are driven.
        """
        waiting = set()
        try:
            for line in lines:
                self.command("mdi", line=line)
                waiting.add(self._last_id)
        except Refused:
            if waiting:
                self._job("mdi", waiting)
            raise
        return self._job("mdi", waiting)

    def load(self, text: str, name: str = "program.ngc") -> Json:
        """Checks a program and keeps it for ``start``."""
        return self.command("load", text=text, name=name)

    def start(self) -> None:
        """Starts the program that is loaded; ``wait`` waits for its end."""
        self.command("start")

    def run(self, text: str, name: str = "program.ngc") -> Job:
        """Loads a program, starts it, and waits for its end."""
        self.load(text, name)
        self.start()
        return self.wait("program")

    def home(self, axis: Optional[str] = None) -> Job:
        """Homes all axes, or one, and waits for the end."""
        self.command("home", **({} if axis is None else {"axis": axis}))
        return self.wait("home")

    def jog(self, axis: str, distance: float, feed: float, degrees: bool = False) -> Job:
        """Jogs an axis by a distance, mm or degrees, and waits for the rest."""
        unit = "deg" if degrees else "mm"
        self.command("jog", axis=axis, **{f"distance_{unit}": distance, f"feed_{unit}_per_min": feed})
        return self.wait("jog")

    def touch_off(self, system: Optional[str] = None, **coordinates: float) -> None:
        """Where the machine stands gets these coordinates, as in ``touch_off(x_mm=0)``, in a work coordinate system."""
        self.command("touch-off", **({} if system is None else {"system": system}), **coordinates)

    def hold(self) -> None:
        """Feed hold; it needs no lease."""
        self.request("hold")

    def emergency_stop(self) -> None:
        """Emergency stop; it needs no lease."""
        self.request("emergency-stop")

    def resume(self) -> None:
        """Goes on after a hold, or where a program waits."""
        self.command("resume")

    def abort(self) -> None:
        """Ends what is driven, at a rest on the path."""
        self.command("abort")

    def reset(self) -> None:
        """Takes a fault or an emergency stop back."""
        self.command("reset")

    def wait(self, kind: str) -> Job:
        """Waits for the end of the job that is driven."""
        return self._job(kind, set())

    def _job(self, kind: str, waiting: Iterable[int]) -> Job:
        lines = set(waiting)
        while True:
            told = self.event()
            if told is None:
                continue
            event = told.get("event")
            if event in ("driven", "not-driven"):
                lines.discard(told["id"])
            elif event == "refused":
                raise Refused(kind, told.get("why", ""), None)
            elif event == "lease" and "lost_to" in told:
                self._has_control = False
            elif event == "job" and told["job"]["job"] == kind and not lines:
                # While lines wait it is the end of the job before theirs.
                of = told["job"]
                summary, position = told.get("summary", {}), told.get("position", {})
                return Job(kind, of["name"], of["outcome"], of.get("fault"), position, summary)

    # Lines

    def _send(self, line: Json) -> None:
        try:
            self._socket.sendall(json.dumps(line).encode() + b"\n")
        except OSError as error:
            raise Gone(f"the controller is gone: {error}") from error

    def _receive(self, timeout_s: Optional[float]) -> Optional[Json]:
        until = None if timeout_s is None else time.monotonic() + timeout_s
        while b"\n" not in self._bytes:
            left = None if until is None else until - time.monotonic()
            if left is not None and left <= 0.0:
                return None
            self._socket.settimeout(left)
            try:
                more = self._socket.recv(1 << 16)
            except socket.timeout:
                return None
            except OSError as error:
                raise Gone(f"the controller is gone: {error}") from error
            if not more:
                raise Gone("the controller has closed the connection")
            self._bytes += more
        line, self._bytes = self._bytes.split(b"\n", 1)
        told: Json = json.loads(line)
        if told.get("event") == "end":
            raise Gone("the controller ends")
        return told
