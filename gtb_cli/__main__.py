"""The process behind `gtb` and ``python -m gtb_cli``: its settings, and signals such as Ctrl-C; statuses: `cli`."""

import gc
import math
import os
import signal
import sys
import time
from types import FrameType

SIGNAL_STATUS = 128  # exit status of a stopped process before the signal's number is added: 130 after Ctrl-C

# Set to 1: the last digit of a sum depends on its split among threads, and small matrices gain nothing by them.
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


class Stopped(KeyboardInterrupt):
    """A signal asked the process to stop; its argument is the number of the signal."""


def main() -> None:
    """Run the command line of this process, and exit."""
    try:
        _catch_signals()
        for name in THREADS:
            os.environ[name] = "1"
        import warnings

        if not sys.warnoptions:
            warnings.simplefilter("ignore")  # messages for users have their own wording
        for stream in (sys.stdout, sys.stderr):
            if stream is not None and hasattr(stream, "reconfigure"):
                stream.reconfigure(errors="backslashreplace")
        gc.set_threshold(100_000)  # objects, not 700: imports make many, and looking for cycles among them takes time
        from gtb_cli.commands.cli import run

        status = run(sys.argv[1:], alone=True)
    except KeyboardInterrupt as stop:
        status = SIGNAL_STATUS + (stop.args[0] if stop.args else signal.SIGINT)
        _discard_unfinished()  # in case the signal came after a file was made and before its removal was certain
    gc.freeze()  # the objects end with the process: searching them for cycles takes a fifth of the time of a plot
    sys.exit(status)


def _catch_signals() -> None:
    """Let the signals that end a process unwind it, so that temporary files go."""
    grace_seconds = 1.0  # seconds after a signal during which further signals do not disturb the clean-up
    names = [name for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    last = -math.inf

    def stop(number: int, frame: FrameType | None) -> None:
        nonlocal last
        while frame is not None:
            if frame.f_code.co_filename.startswith("<frozen importlib"):
                # Some imported code swallows exceptions: the process would not stop.
                _discard_unfinished()
                os._exit(SIGNAL_STATUS + number)
            frame = frame.f_back
        now = time.monotonic()
        if now - last > grace_seconds:
            last = now
            raise Stopped(number)

    for name in names:
        number = getattr(signal, name)
        if signal.getsignal(number) != signal.SIG_IGN:  # as under nohup
            signal.signal(number, stop)


def _discard_unfinished() -> None:
    """Remove unfinished files, if there are any."""
    if discard := getattr(sys.modules.get("gtb_cli.files"), "discard", None):
        discard()


if __name__ == "__main__":
    main()
