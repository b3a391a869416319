"""Named steps of a script, each of which ends as a line `ok …` or `FAILED …`."""

import signal
import sys
import threading
import time
import traceback


class Failure(Exception):
    """What was expected did not come."""


class Stopped(Exception):
    """The rest of the script makes no sense."""


# Seconds between two looks, and what such a pause counts at most: if it lasts longer, nobody here had a processor.
LOOK = 0.01
LONGEST_LOOK = 0.03


def wait_for(what, condition, timeout):
    """Returns what `condition` gives as soon as that is true; `what` says what is missing after `timeout` seconds."""
    deadline = time.monotonic() + timeout
    while True:
        result = condition()
        if result:
            return result
        slept_at = time.monotonic()
        if slept_at > deadline:
            raise Failure(f"not within {timeout:g} s: {what() if callable(what) else what}")
        time.sleep(LOOK)
        deadline += max(0, time.monotonic() - slept_at - LONGEST_LOOK)


def expect(condition, otherwise):
    if not condition:
        raise Failure(otherwise)


def angle_between(one, other):
    """Degrees from one direction to another, the shorter way around."""
    return abs((one - other + 180) % 360 - 180)


class Steps:
    """Runs steps, counts them, and ends the script with the code that they deserve. Steps may run on several threads."""

    def __init__(self, prefix):
        self.prefix = prefix
        self._lock = threading.Lock()
        self._failed = 0
        # The clean-up of every `with` has to run also when the time of the script is over.
        signal.signal(signal.SIGTERM, lambda *_: sys.exit("stopped from outside"))

    def run(self, name, step, essential=False):
        """Runs `step()`; a text that it returns, such as a measurement, is printed behind the name."""
        started = time.monotonic()
        try:
            remark = step()
        except Failure as failure:
            self._fail(name, str(failure))
        except Exception as error:  # whatever a client library throws
            traceback.print_exc()
            self._fail(name, f"{type(error).__name__}: {error}")
        else:
            remark = f" ({remark})" if remark else ""
            self._say(f"ok {self.prefix}: {name}{remark}")
            print(f"{name}: {time.monotonic() - started:.2f} s", file=sys.stderr, flush=True)
            return
        if essential:
            raise Stopped(name)

    def _fail(self, name, reason):
        with self._lock:
            self._failed += 1
        self._say(f"FAILED {self.prefix}: {name}: {' '.join(reason.split())}")

    def _say(self, line):
        with self._lock:
            print(line, flush=True)

    def script(self, body):
        """Runs the whole script."""
        try:
            body()
        except Stopped as stopped:
            print(f"{self.prefix}: the other steps need '{stopped}'", flush=True)
        except Failure as failure:
            self._fail("set-up", str(failure))
        sys.exit(1 if self._failed else 0)
