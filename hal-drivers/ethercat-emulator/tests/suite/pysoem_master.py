"""SOEM, through pysoem, against the emulated bus of examples/buses/mill.toml on an interface."""

import struct
import sys
import time

import pysoem

DRIVES = [0, 1, 2]
SPINDLE = 3


def check(good, what):
    if not good:
        raise AssertionError(what)


def long_sdo(drive):
    there = drive.sdo_read(0x2000, 0)
    check(len(there) == 200, f"{len(there)} bytes of 0x2000")
    new = bytes(reversed(there))
    drive.sdo_write(0x2000, 0, new)
    check(drive.sdo_read(0x2000, 0) == new, "0x2000 is not what was written")


def refused(drive):
    try:
        drive.sdo_read(0x5555, 0)
    except pysoem.SdoError as error:
        check(error.abort_code == 0x06020000, f"abort {error.abort_code:08x}")
        return
    raise AssertionError("an object that is not there was read")


def remap_spindle(spindle):
    for assignment, pdo in [(0x1C12, 0x1601), (0x1C13, 0x1A01)]:
        spindle.sdo_write(assignment, 0, b"\0")
        spindle.sdo_write(assignment, 1, struct.pack("<H", pdo))
        spindle.sdo_write(assignment, 0, b"\1")


def state(master, wanted, timeout_s):
    """Asks for a state and exchanges process data until every device is in it."""
    master.state = wanted
    master.write_state()
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        master.send_processdata()
        master.receive_processdata(20000)
        master.read_state()
        if all(device.state == wanted for device in master.slaves):
            return
        time.sleep(0.001)
    found = [(device.name, hex(device.state), hex(device.al_status)) for device in master.slaves]
    raise AssertionError(f"not in state {wanted}: {found}")


def enable(master):
    commands = [0x80, 0x06, 0x07, 0x0F]
    for control, wanted in zip(commands, [0x40, 0x21, 0x23, 0x27]):
        for _ in range(2000):
            for number in DRIVES:
                drive = master.slaves[number]
                position = drive.input[4:8] if len(drive.input) >= 8 else bytes(4)
                drive.output = struct.pack("<HbB", control, 8, 0) + position + bytes(6)
            master.slaves[SPINDLE].output = struct.pack("<HbBi", control, 9, 0, 0)
            master.send_processdata()
            master.receive_processdata(20000)
            words = [struct.unpack("<H", master.slaves[n].input[0:2])[0] for n in DRIVES + [SPINDLE]]
            if all(word & 0x6F == wanted for word in words):
                break
            time.sleep(0.001)
        else:
            raise AssertionError(f"status words {[hex(word) for word in words]} after {control:#x}")


def main(interface):
    master = pysoem.Master()
    master.open(interface)
    try:
        check(master.config_init() == 8, f"{len(master.slaves)} devices")
        names = [device.name for device in master.slaves]
        check(names[:4] == ["TANDEM-402"] * 4 and names[4] == "EK1100", str(names))
        long_sdo(master.slaves[0])
        refused(master.slaves[0])
        remap_spindle(master.slaves[SPINDLE])
        master.config_map()
        sizes = [(len(device.output), len(device.input)) for device in master.slaves]
        check(sizes == [(14, 26)] * 3 + [(8, 10), (0, 0), (0, 1), (1, 0), (0, 8)], str(sizes))
        check(master.config_dc(), "no distributed clocks")
        master.state_check(pysoem.SAFEOP_STATE, 5_000_000)
        state(master, pysoem.OP_STATE, 5)
        print("operational", flush=True)
        enable(master)
        print("enabled", flush=True)
        count = master.expected_wkc
        for _ in range(200):
            master.send_processdata()
            check(master.receive_processdata(20000) == count, "the working counter is low")
        if len(sys.argv) > 2:
            # To be killed from outside.
            while True:
                master.send_processdata()
                master.receive_processdata(20000)
                time.sleep(0.001)
        state(master, pysoem.SAFEOP_STATE, 5)
        master.state = pysoem.INIT_STATE
        master.write_state()
        check(master.state_check(pysoem.INIT_STATE, 5_000_000) == pysoem.INIT_STATE, "not back in INIT")
        print("done", flush=True)
    finally:
        master.close()


main(sys.argv[1])
