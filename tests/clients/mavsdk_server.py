"""The server that comes with the Python packages of MAVSDK 1 to 3, and its client on an event loop of its own."""

import asyncio
import pathlib
import socket
import threading

import mavsdk

from rig import LOGS, Process, free_port


class Server(Process):
    def __init__(self, connection, log):
        self.grpc_port = free_port(socket.SOCK_STREAM)
        binary = pathlib.Path(mavsdk.__file__).parent / "bin/mavsdk_server"
        super().__init__("mavsdk_server", [str(binary), "-p", str(self.grpc_port), connection], LOGS / log)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.kill()


class Library:
    """The library on a thread, so that a script can wait for it with deadlines."""

    def __init__(self, grpc_port):
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self._streams = []
        self.drone = mavsdk.System("localhost", grpc_port)
        self.call(self.drone.connect(), 20)
        self.call(self._connected(), 10)

    def call(self, coroutine, timeout=5):
        return asyncio.run_coroutine_threadsafe(coroutine, self._loop).result(timeout)

    def follow(self, stream, handle):
        """Has `handle` called with all that comes."""

        async def run():
            async for item in stream:
                handle(item)

        self._streams.append(asyncio.run_coroutine_threadsafe(run(), self._loop))

    def close(self):
        for stream in self._streams:
            stream.cancel()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(5)

    async def _connected(self):
        async for state in self.drone.core.connection_state():
            if state.is_connected:
                return
