"""`gimbald demo` as somebody uses it who tries it out, with pymavlink in place of the ground stations."""

import json
import socket

import pymavlink

from ground import GroundStation, mavlink
from rig import GIMBALD, LOGS, Process, free_port, get, port_is_free
from steps import Steps, expect, wait_for

# Where the demo lets a second client in.
CLIENT_PORT = 14551


def body(steps):
    if not port_is_free(CLIENT_PORT):
        print(f"skipped: another program has UDP port {CLIENT_PORT}, which the demo needs", flush=True)
        return
    LOGS.mkdir(parents=True, exist_ok=True)
    ground_port = free_port()
    page = f"127.0.0.1:{free_port(socket.SOCK_STREAM)}"
    log = LOGS / "demo.log"
    arguments = [GIMBALD, "demo", "--ground", f"udpout:127.0.0.1:{ground_port}", "--http", page]
    demo = Process("gimbald demo", arguments, log)
    ended = False

    def says_how():
        def text():
            demo.check()
            said = log.read_text()
            return said if "Ctrl-C ends it." in said else None

        said = wait_for("what to do next", text, 5)
        for wanted in (f"http://{page}", f"udpout://127.0.0.1:{CLIENT_PORT}", f"127.0.0.1:{ground_port}"):
            expect(wanted in said, f"it does not say {wanted}")

    def shows_gimbal():
        def gimbal():
            demo.check()
            try:
                gimbals = json.loads(get(f"http://{page}/api/v1/status")[1])["gimbals"]
            except OSError:
                return None  # the page is not up yet
            return gimbals and gimbals[0]["state"] == "alive" and gimbals[0]

        found = wait_for("a gimbal that is alive", gimbal, 10)
        expect(found["device"] == "1/154", f"it is {found['device']}")
        code, content = get(f"http://{page}/")
        expect(code == 200 and b"<html" in content.lower(), f"the page answers {code}")
        code, reasons = get(f"http://{page}/readyz")
        expect(code == 200, f"not ready: {reasons.decode()}")

    def moves():
        with GroundStation(CLIENT_PORT, 255) as client:
            wait_for("the manager", lambda: client.heard("HEARTBEAT", (1, 191)), 5)
            expect(client.pitchyaw(-35, 25) == mavlink.MAV_RESULT_ACCEPTED, "not accepted")
            client.attitudes.wait_at(pitch=-35, yaw_vehicle=25)
            client.check()

    def ends():
        nonlocal ended
        code = demo.end()
        ended = True
        expect(code == 0, f"it ended with {code}")

    try:
        steps.run("says how to connect", says_how, essential=True)
        steps.run("shows the gimbal on its page", shows_gimbal, essential=True)
        steps.run("a client moves the gimbal", moves)
        steps.run("ends when asked to", ends)
    finally:
        if not ended:
            demo.kill()


def main():
    steps = Steps(f"demo with pymavlink {pymavlink.__version__}")
    steps.script(lambda: body(steps))


main()
