"""Starts MAVProxy where nothing can be drawn: `mavproxy_headless.py MAVPROXY [ARGUMENT…]`.

Its gimbal module asks for the map, to draw on it what the camera sees, and the map asks for a screen. All else of the
module works without.
"""

import runpy
import sys
import types

no_map = types.ModuleType("MAVProxy.modules.mavproxy_map")
no_map.mp_slipmap = types.ModuleType("MAVProxy.modules.mavproxy_map.mp_slipmap")
for module in (no_map, no_map.mp_slipmap):
    sys.modules[module.__name__] = module

del sys.argv[0]
runpy.run_path(sys.argv[0], run_name="__main__")
