"""KickCAT against the emulated bus of examples/buses/mill.toml on an interface."""

import sys
import time

import kickcat
from kickcat import State


def nothing(*_):
    pass


def main(interface):
    link = kickcat.create_link(interface, "")
    # Its own 2 ms are less than an ordinary kernel sometimes takes.
    link.set_timeout(0.02)
    bus = kickcat.Bus(link)
    bus.init(0.1)
    devices = bus.slaves()
    assert len(devices) == 8, len(devices)
    vendor = bus.read_sdo(devices[0], 0x1018, 1, kickcat.PARTIAL, 64, 1.0)
    assert int.from_bytes(vendor[:4], "little") == 0x0E1A, vendor
    bus.create_mapping()
    sizes = [(device.output_size, device.input_size) for device in devices]
    assert sizes[0] == (14, 26), sizes
    bus.request_state(State.SAFE_OP)
    bus.wait_for_state(State.SAFE_OP, 2.0)
    for device in devices:
        if device.output_size:
            device.set_output_bytes(bytes(device.output_size))
    bus.process_data_no_check()
    bus.request_state(State.OPERATIONAL)
    end = time.monotonic() + 3
    while True:
        bus.process_data_no_check()
        try:
            bus.wait_for_state(State.OPERATIONAL, 0.02)
            break
        except Exception:
            if time.monotonic() > end:
                raise
    for _ in range(100):
        bus.process_data()
    print("done", flush=True)


main(sys.argv[1])
