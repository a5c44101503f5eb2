"""Streams a program with grbl-streamer, as it comes from PyPI but for one lock: python3 grbl_streamer.py FOLDER TERMINAL PROGRAM."""
import sys
import threading
import time

folder, terminal, program = sys.argv[1:4]
sys.path.insert(0, folder + "/py")
from grbl_streamer import GrblStreamer  # noqa: E402

booted, finished, failed = threading.Event(), threading.Event(), []


def hear(event, *data):
    if event == "on_boot":
        booted.set()
    elif event == "on_job_completed":
        finished.set()
    elif event in ("on_error", "on_alarm"):
        failed.append((event, data))
        finished.set()


class Streamer(GrblStreamer):
    """The thread that starts a job and the one that hears `ok` both send lines: where one of them is held up on a busy computer, a line
    comes behind dozens of later ones, and the machine drives back to it."""

    sending = threading.RLock()

    def _stream(self):
        with self.sending:
            super()._stream()


grbl = Streamer(hear)
began = time.monotonic()
grbl.cnect(terminal, 115200)
if not booted.wait(10):
    sys.exit("it was not greeted")
print(f"connected after {time.monotonic() - began:.1f} s", flush=True)
time.sleep(0.5)
grbl.incremental_streaming = False
grbl.poll_start()
grbl.load_file(program)
finished.clear()
grbl.job_run()
finished.wait(300)
while grbl.cmode == "Run":
    time.sleep(0.1)
time.sleep(0.5)
print("stands at", *grbl.cmpos, flush=True)
grbl.poll_stop()
grbl.disconnect()
if failed:
    sys.exit(str(failed))
