"""Six STS3215 servos of the tests on a pseudo-terminal, by the packets that LeRobot's driver for them sends.

Instruction packet: FF FF id length instruction parameters… checksum. Status packet: FF FF id length error
parameters… checksum. The checksum is the complement of the sum after the header; numbers are little-endian.
It needs the standard library alone, and runs in the test's process.
"""

import os
import pty
import threading
import time
import tty
from contextlib import suppress

__all__ = ["FeetechBus"]

PING, READ, WRITE, SYNC_READ, SYNC_WRITE = 0x01, 0x02, 0x03, 0x82, 0x83
FIRMWARE, MODEL, MINIMUM, MAXIMUM, OFFSET, TORQUE, GOAL, PRESENT = 0, 3, 9, 11, 31, 40, 42, 56
STS3215 = 777
SPEED = 1500.0  # steps/s
FALL = 600.0  # steps/s, of the motor that carries the arm, without torque
CARRIES = 2
FLOOR = 1000


class Servo:
    """The registers of one motor."""

    def __init__(self, place: int, limits: tuple[int, int], fall: float) -> None:
        self._fall = fall
        self.memory = bytearray(128)
        self.place = float(place)
        self.put(FIRMWARE, bytes([3, 10]))
        self.put16(MODEL, STS3215)
        self.put16(MINIMUM, limits[0])
        self.put16(MAXIMUM, limits[1])
        self.put16(GOAL, place)
        self.put16(PRESENT, place)
        self._time = time.monotonic()

    @property
    def has_torque(self) -> bool:
        return self.memory[TORQUE] == 1

    def put(self, address: int, data: bytes) -> None:
        self.memory[address : address + len(data)] = data

    def put16(self, address: int, value: int) -> None:
        self.put(address, value.to_bytes(2, "little"))

    def move(self) -> None:
        """Let the time since the last call pass."""
        now = time.monotonic()
        dt, self._time = now - self._time, now
        goal = int.from_bytes(self.memory[GOAL : GOAL + 2], "little")
        if self.has_torque:
            self.place += min(max(goal - self.place, -SPEED * dt), SPEED * dt)
        else:
            self.place = max(self.place - self._fall * dt, min(self.place, FLOOR))
        self.put16(PRESENT, round(self.place))


class FeetechBus:
    """The bus; `port` is what LeRobot opens. `unplug` makes the motors silent."""

    def __init__(self, places: dict[int, int], limits: dict[int, tuple[int, int]]) -> None:
        self.servos = {
            number: Servo(place, limits[number], FALL if number == CARRIES else 0.0) for number, place in places.items()
        }
        self.written: list[tuple[int, int]] = []  # id and address of each write
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self._is_plugged = True
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def unplug(self) -> None:
        self._is_plugged = False

    def place(self, number: int) -> float:
        with self._lock:
            self.servos[number].move()
            return self.servos[number].place

    def turn(self, number: int, steps: float) -> None:
        """A hand turns a motor that has no torque."""
        with self._lock:
            self.servos[number].move()
            self.servos[number].place += steps

    def close(self) -> None:
        os.close(self._slave)
        self._thread.join(5)  # the last end of the terminal is closed, so that the reading ends
        os.close(self._master)

    def _run(self) -> None:
        waiting = b""
        # LeRobot waits for some milliseconds and asks once. The motors of an arm answer whatever its computer does.
        with suppress(PermissionError):
            os.sched_setscheduler(threading.get_native_id(), os.SCHED_RR, os.sched_param(1))
        while True:
            try:
                waiting += os.read(self._master, 4096)
            except OSError:
                return
            while (packet := _next(waiting)) is not None:
                waiting = waiting[len(packet) :]
                if packet[:2] == b"\xff\xff":
                    with self._lock:
                        answer = self._answer(packet[2], packet[4], packet[5:-1])
                    if answer and self._is_plugged:
                        os.write(self._master, answer)

    def _answer(self, number: int, instruction: int, given: bytes) -> bytes:
        for servo in self.servos.values():
            servo.move()
        if instruction == SYNC_WRITE:
            address, size = given[0], given[1]
            for start in range(2, len(given), size + 1):
                self._write(given[start], address, given[start + 1 : start + 1 + size])
            return b""
        if instruction == SYNC_READ:
            return b"".join(self._status(each, self._read(each, given[0], given[1])) for each in given[2:])
        if number not in self.servos:
            return b""
        if instruction == READ:
            return self._status(number, self._read(number, given[0], given[1]))
        if instruction == WRITE:
            self._write(number, given[0], given[1:])
        return self._status(number, b"")

    def _read(self, number: int, address: int, size: int) -> bytes:
        return bytes(self.servos[number].memory[address : address + size])

    def _write(self, number: int, address: int, data: bytes) -> None:
        self.servos[number].put(address, data)
        self.written.append((number, address))
        del self.written[:-1000]

    @staticmethod
    def _status(number: int, data: bytes) -> bytes:
        body = bytes([number, len(data) + 2, 0]) + data
        return b"\xff\xff" + body + bytes([~sum(body) & 0xFF])


def _next(waiting: bytes) -> bytes | None:
    """Return the next whole packet, or one byte that begins none; None if more has to come."""
    if not waiting:
        return None
    if waiting[:2] != b"\xff\xff"[: len(waiting[:2])]:
        return waiting[:1]
    if len(waiting) < 4 or len(waiting) < 4 + waiting[3]:
        return None
    return waiting[: 4 + waiting[3]]
