"""A day at a machine, over a socket: home, jog, touch off, lines, a program, hold, abort, fault, reset, the process anew.

TANDEM names the command, as in ``TANDEM=target/debug/tandem python3 -m unittest discover scripts/python/tests``.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).resolve().parent.parent
REPOSITORY = PACKAGE.parent.parent
sys.path.insert(0, str(PACKAGE))

from tandem_client import Client, Gone, Refused, find_controller  # noqa: E402

TANDEM = os.environ.get("TANDEM", "tandem")
PATIENCE_S = 60.0
LONG = "G21 G90\nF600\n" + "G1 X50\nG1 X0\n" * 5 + "M2\n"


class Controller:
    """A controller in a process of its own, with a folder that outlives it."""

    def __init__(self, folder: Path, machine: str, *more: str) -> None:
        self.folder = folder
        self.arguments = [
            TANDEM, "serve", "--machine", str(REPOSITORY / "examples/machines" / machine),
            "--listen", "tandem-day.socket", "--state", "state.sqlite",
            # How late a busy computer wakes the loop is not what is asked here.
            "--set", "loops.max_missed_periods=1000000", "--set", "loops.max_missed_share=1", *more,
        ]  # fmt: skip
        self.start()

    def start(self) -> None:
        """Starts the process, and waits for its door."""
        with open(self.folder / "log", "ab") as log:
            self.process = subprocess.Popen(self.arguments, cwd=self.folder, stderr=log, stdin=subprocess.DEVNULL)
        until = time.monotonic() + PATIENCE_S
        while True:
            try:
                with Client(self.socket) as client:
                    client.wait_for_state("ready", "homing-needed")
                    return
            except OSError:
                if self.process.poll() is not None or time.monotonic() > until:
                    raise AssertionError((self.folder / "log").read_text()) from None
                time.sleep(0.02)

    @property
    def socket(self) -> Path:
        """Its door."""
        return self.folder / "tandem-day.socket"

    def end(self, how: signal.Signals = signal.SIGTERM) -> int:
        """Ends the process; its exit status."""
        self.process.send_signal(how)
        return self.process.wait(PATIENCE_S)


class WithController(unittest.TestCase):
    """Each test has a controller of its own."""

    def controller(self, machine: str, *more: str) -> Controller:
        """A controller that the test ends with."""
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        controller = Controller(Path(folder.name), machine, *more)
        self.addCleanup(lambda: controller.process.poll() is None and controller.end(signal.SIGKILL))
        return controller


class Day(WithController):
    """What people do over a socket."""

    def test_a_day(self) -> None:
        """What an operator does from morning to evening, in one process, and in the next one."""
        controller = self.controller("mill-homing.toml", "--set", "probe.input=20")
        with Client(controller.socket) as machine:
            self.assertEqual(machine.greeting["machine"], "three-axis mill with home switches")
            with self.assertRaises(Refused) as refused:
                machine.mdi("G0 X1")
            self.assertEqual(refused.exception.state, "homing-needed")
            self.assertTrue(machine.home().is_done)
            self.assertEqual(machine.status()["not_homed"], [])
            before = machine.status()["position"]["x_mm"]
            self.assertAlmostEqual(machine.jog("x", 2.5, 1200).position["x_mm"], before + 2.5, places=9)
            machine.touch_off(x_mm=0)
            self.assertAlmostEqual(machine.status()["work_position"]["x_mm"], 0, places=9)
            # Lines that come in time are one motion.
            lines = machine.mdi("G1 F3000", *(f"G1 X{at / 10}" for at in range(1, 100)))
            self.assertAlmostEqual(lines.position["x_mm"], before + 2.5 + 9.9, places=9)
            with self.assertRaises(Refused) as refused:
                machine.mdi("G0 X1", "G1 X", "G0 X2")
            self.assertIn("X has no value", refused.exception.why)
            self.assertAlmostEqual(machine.status()["work_position"]["x_mm"], 1, places=9)
            job = machine.run("G21 G90\nG0 X0\nF1200\nG1 X3\nM2\n", "short.ngc")
            self.assertTrue(job.is_done)
            self.assertEqual(job.summary["guard_stops"], 0)

            machine.load(LONG, "long.ngc")
            machine.start()
            machine.wait_for_state("running")
            machine.hold()
            machine.wait_for_state("held")
            rest = machine.wait_for_rest()
            self.assertEqual((rest["state"], rest["position"]), ("held", machine.status()["position"]))
            with Client(controller.socket) as other, self.assertRaises(Refused):
                other.request("resume")
            machine.resume()
            machine.wait_for_state("running")
            machine.abort()
            self.assertEqual(machine.wait("program").outcome, "aborted")
            self.assertEqual(machine.wait_for_state("ready")["modal"], machine.status()["modal"])

            # Nothing is there to be probed: a fault, and the connection outlives it.
            missed = machine.mdi("G91 G38.2 Z-1 F600")
            self.assertEqual(missed.outcome, "fault")
            self.assertIsNotNone(missed.fault)
            self.assertEqual(machine.status()["state"], "fault")
            with self.assertRaises(Refused):
                machine.start()
            machine.reset()
            machine.emergency_stop()
            machine.wait_for_state("emergency-stop")
            machine.reset()
            state = machine.wait_for_state("ready", "homing-needed")["state"]
            if state == "homing-needed":
                self.assertTrue(machine.home().is_done)
            self.assertTrue(machine.run("G90 G0 X1\nM2\n").is_done)
            self.assertAlmostEqual(machine.status()["work_position"]["x_mm"], 1, places=9)
            offset = machine.status()["offset"]

            self.assertEqual(controller.end(), 0)
            with self.assertRaises(Gone):
                machine.status()
        controller.start()
        with Client(controller.socket) as machine:
            status = machine.status()
            self.assertEqual(status["offset"], offset)
            # Drives that do not know where they stand are homed anew.
            self.assertEqual(status["state"], "homing-needed")

    def test_killed_in_the_middle(self) -> None:
        """What was acknowledged lasts, whenever the process dies."""
        controller = self.controller("mill-3axis.toml")
        with Client(controller.socket) as machine:
            machine.command("set-parameter", number=500, value=7.25)
            machine.touch_off("G55", y_mm=-3)
            machine.load(LONG)
            machine.start()
            machine.wait_for_state("running")
            controller.end(signal.SIGKILL)
            with self.assertRaises(Gone):
                machine.wait("program")
        controller.start()
        with Client(controller.socket) as machine:
            self.assertAlmostEqual(machine.mdi("G55 G0 Y#500").position["y_mm"], 10.25, places=9)

    def test_the_only_controller_is_found(self) -> None:
        """Where the command looks for it."""
        controller = self.controller("mill-3axis.toml")
        before = dict(os.environ)
        self.addCleanup(os.environ.update, before)
        os.environ.pop("RUNTIME_DIRECTORY", None)
        os.environ["XDG_RUNTIME_DIR"] = str(controller.folder)
        self.assertEqual(find_controller(), controller.socket)
        os.environ["XDG_RUNTIME_DIR"] = str(controller.folder / "empty")
        self.assertRaises(FileNotFoundError, find_controller)


class Examples(WithController):
    """The examples, as people run them."""

    def example(self, controller: Controller, name: str, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Runs an example against a controller."""
        environment = {
            **os.environ, "XDG_RUNTIME_DIR": str(controller.folder), "PYTHONPATH": str(PACKAGE),
        }  # fmt: skip
        environment.pop("RUNTIME_DIRECTORY", None)
        return subprocess.run(
            [sys.executable, str(PACKAGE / "examples" / name), *arguments],
            cwd=controller.folder, env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip

    def test_batch(self) -> None:
        """Summaries are kept, and the first program that is refused ends it."""
        controller = self.controller("mill-3axis.toml")
        for name, text in (("a.ngc", "G0 X1\nM2\n"), ("b.ngc", "G0 Y1\nM2\n"), ("bad.ngc", "G1 X\n")):
            (controller.folder / name).write_text(text)
        done = self.example(controller, "batch.py", "kept", "a.ngc", "b.ngc")
        self.assertEqual(done.returncode, 0, done.stderr)
        kept: dict[str, Any] = json.loads((controller.folder / "kept/b.json").read_text())
        self.assertEqual(kept["end_position_mm"]["y"], 1)
        refused = self.example(controller, "batch.py", "kept", "bad.ngc", "a.ngc")
        self.assertEqual(refused.returncode, 1)
        self.assertIn("bad.ngc:1:4", refused.stderr)

    def test_touch_off(self) -> None:
        """The plate of the example machine lies at Z-5.3."""
        controller = self.controller("mill-probe.toml")
        with Client(controller.socket) as machine:
            machine.mdi("G0 X-30")
            machine.release_control()
            done = self.example(controller, "touch_off.py", "G56")
            self.assertEqual(done.returncode, 0, done.stderr)
            status = machine.status()
            self.assertEqual(status["system"], "G56")
            top = status["position"]["z_mm"] - status["work_position"]["z_mm"]
            self.assertAlmostEqual(top, -5.3, delta=0.001)

    def test_plot_capture(self) -> None:
        """Every sample of the line is in the plot."""
        controller = self.controller("mill-3axis.toml")
        plotted = self.example(controller, "plot_capture.py", "x.svg", "G91 G0 X10", "x_cmd_mm", "feed_mm_s")
        if "no such request" in plotted.stderr:
            self.skipTest("this controller captures nothing")
        self.assertEqual(plotted.returncode, 0, plotted.stderr)
        plot = (controller.folder / "x.svg").read_text()
        self.assertEqual(plot.count("<polyline"), 2)
        self.assertRegex(plot, r"x_cmd_mm  [0-9.e-]+ to 10, 0 s to")
        refused = self.example(controller, "plot_capture.py", "y.svg", "G91 G0 X1", "q_cmd_mm")
        self.assertEqual(refused.returncode, 1)
        self.assertIn("q_cmd_mm", refused.stderr)


if __name__ == "__main__":
    unittest.main()
