"""When nobody had a processor here: what takes long in such a moment says nothing about the daemon."""

import os
import threading
import time

# Seconds: how often it looks, and from when on it was too late for that.
LOOK = 0.01
LATE = 0.04

# When each stall began and ended, by `time.monotonic()`, in the order of their ends.
_seen = []


def _watch(processor):
    os.sched_setaffinity(threading.get_native_id(), {processor})
    before = time.monotonic()
    while True:
        time.sleep(LOOK)
        now = time.monotonic()
        if now - before > LATE:
            _seen.append((before, now))
        before = now


# A thread on each processor that sleeps, and notes when it was woken late.
for _processor in os.sched_getaffinity(0):
    threading.Thread(target=_watch, args=[_processor], daemon=True).start()


def stalled(since, until):
    """How many seconds of these."""
    # A stall that is just over is noted when its own thread has been woken as well.
    time.sleep(LATE)
    total, counted_to = 0.0, since
    for begin, end in sorted(_seen):
        # Two processors may have stalled at once.
        begin, end = max(begin, counted_to), min(end, until)
        if end > begin:
            total += end - begin
            counted_to = end
    return total
