"""Reads the model's sensors: force and torque, touch, and distances."""

import math
from collections.abc import Sequence
from typing import Any, Final

import mujoco
import numpy as np
import numpy.typing as npt

from lockstep.protocol.description import Body, RangeRing, WrenchSensor
from lockstep.robot_bridge.robots.mjcf.names import name_of

__all__ = ["RangeSense", "WrenchSense", "range_sense", "wrench_sense"]

Array = npt.NDArray[np.float64]

FORCE, TORQUE, TOUCH, RANGE = (
    int(getattr(mujoco.mjtSensor, f"mjSENS_{kind}")) for kind in ("FORCE", "TORQUE", "TOUCH", "RANGEFINDER")
)
SITE: Final = int(mujoco.mjtObj.mjOBJ_SITE)
TIME_CONSTANT: Final = 0.03  # s of the low-pass
FELT: Final = 0.03  # of full scale, from which on a force is felt
LEAST_FORCE: Final = 1e-6  # N of full scale
GRAVITY: Final = 9.81  # m/s², for a guess at the full scale
EVEN: Final = 0.02  # rad by which rays may be off an even ring


class WrenchSense:
    """Force and torque on a body of the robot, in that body's frame. Call `read` after each step."""

    def __init__(self, model: Any, body: int, full_scale: float) -> None:
        self.description = WrenchSensor(
            name="contact",
            body=name_of(model, "body", body),
            threshold_force=FELT * full_scale,
            full_scale_force=full_scale,
            full_scale_torque=full_scale * 0.5 * float(model.stat.extent),
        )
        self._body = body
        self.value: Array = np.zeros(6)

    def read(self, data: Any, seconds: float) -> None:
        share = -math.expm1(-seconds / TIME_CONSTANT)
        self.value = self.value + (self._now(data) - self.value) * share

    def clear(self) -> None:
        self.value = np.zeros(6)

    def _now(self, data: Any) -> Array:
        raise NotImplementedError

    def _in_body(self, data: Any, world: Array) -> Array:
        turned: Array = world @ data.xmat[self._body].reshape(3, 3)
        return turned


class ForceSense(WrenchSense):
    """Reads a force sensor, and a torque sensor on the same site if there is one, less the weight that hangs on it."""

    def __init__(self, model: Any, force: int, torque: int | None) -> None:
        self._site = int(model.sensor_objid[force])
        body = int(model.site_bodyid[self._site])
        cutoff = float(model.sensor_cutoff[force])
        super().__init__(model, body, cutoff if cutoff > 0 else _guess(model))
        self._force = int(model.sensor_adr[force])
        self._torque = None if torque is None else int(model.sensor_adr[torque])
        self._weight = float(model.body_subtreemass[body]) * model.opt.gravity

    def _now(self, data: Any) -> Array:
        turn = data.site_xmat[self._site].reshape(3, 3)
        # The sensor measures what holds the hand; the force from outside is the opposite, less the weight.
        force = -turn @ data.sensordata[self._force : self._force + 3] - self._weight
        if self._torque is None:
            return np.concatenate((self._in_body(data, force), np.zeros(3)))
        lever = data.subtree_com[self._body] - data.site_xpos[self._site]
        torque = -turn @ data.sensordata[self._torque : self._torque + 3] - np.cross(lever, self._weight)
        return np.concatenate((self._in_body(data, force), self._in_body(data, torque)))


class TouchSense(WrenchSense):
    """Reads touch sensors: the sensors tell the strength, the contacts of their bodies the direction."""

    def __init__(self, model: Any, sensors: Sequence[int]) -> None:
        sites = [int(model.sensor_objid[sensor]) for sensor in sensors]
        bodies = [int(model.site_bodyid[site]) for site in sites]
        cutoff = sum(float(model.sensor_cutoff[sensor]) for sensor in sensors)
        super().__init__(model, bodies[0], cutoff if cutoff > 0 else _guess(model))
        self._values = [int(model.sensor_adr[sensor]) for sensor in sensors]
        self._is_touching = np.isin(model.geom_bodyid, bodies)  # per geom
        self._model = model

    def _now(self, data: Any) -> Array:
        strength = float(data.sensordata[self._values].sum())
        if strength <= 0 or not data.ncon:
            return np.zeros(6)
        world, part = np.zeros(3), np.zeros(6)
        ours = self._is_touching[data.contact.geom]
        for number in np.flatnonzero(ours[:, 0] != ours[:, 1]):
            mujoco.mj_contactForce(self._model, data, int(number), part)
            sign = 1.0 if ours[number, 1] else -1.0  # the force acts on the second geom
            world += sign * (data.contact.frame[number].reshape(3, 3).T @ part[:3])
        size = float(np.linalg.norm(world))
        if size == 0:
            return np.zeros(6)
        return np.concatenate((self._in_body(data, world / size * strength), np.zeros(3)))


class RangeSense:
    """Reads rangefinders: a ring if they stand evenly around one body, else only the first.

    Attributes:
        description: describes the ring, or a single ray
        body: the body that they sit on, whose x is the direction of a single ray
    """

    def __init__(self, ring: RangeRing, body: Body, values: Sequence[int]) -> None:
        self.description = ring
        self.body = body
        self._values = list(values)

    def read(self, data: Any) -> list[float]:
        found = data.sensordata[self._values]
        far = self.description.range_max
        return [far if value < 0 or value > far else float(value) for value in found]


def wrench_sense(model: Any) -> WrenchSense | None:
    """Return the sense of force or touch; None if the model has no such sensor."""
    forces, torques, touches = (_sensors(model, kind) for kind in (FORCE, TORQUE, TOUCH))
    if forces:
        site = model.sensor_objid[forces[0]]
        return ForceSense(model, forces[0], next((each for each in torques if model.sensor_objid[each] == site), None))
    return TouchSense(model, touches) if touches else None


def range_sense(model: Any, data: Any) -> RangeSense | None:
    """Return the sense of distances; None if the model has no rangefinder. `data` has the model's first posture."""
    sensors = [each for each in _sensors(model, RANGE) if model.sensor_dim[each] == 1]
    if not sensors:
        return None
    sites = [int(model.sensor_objid[each]) for each in sensors]
    body = int(model.site_bodyid[sites[0]])
    frame = data.xmat[body].reshape(3, 3)
    directions = [frame.T @ data.site_xmat[site].reshape(3, 3)[:, 2] for site in sites]  # a ray goes along z
    angles = [math.atan2(float(each[1]), float(each[0])) for each in directions]
    order = sorted(range(len(sensors)), key=lambda index: angles[index])
    steps = [angles[late] - angles[early] for early, late in zip(order, order[1:], strict=False)]
    is_ring = bool(steps) and all(model.site_bodyid[site] == body for site in sites)
    is_ring = is_ring and max(abs(float(each[2])) for each in directions) < EVEN
    is_ring = is_ring and max(steps) - min(steps) < EVEN and min(steps) > EVEN
    chosen = order if is_ring else [0]
    cutoff = max(float(model.sensor_cutoff[each]) for each in sensors)
    name = name_of(model, "body", body)
    x, y, z = (float(part) for part in model.site_pos[sites[chosen[0]]])
    turn = (1.0, 0.0, 0.0, 0.0) if is_ring else _turned(directions[0])
    ring = RangeRing(
        name="ranges",
        body=f"{name}.rays",
        count=len(chosen),
        angle_min=angles[chosen[0]] if is_ring else 0.0,
        angle_increment=sum(steps) / len(steps) if is_ring else 0.0,
        range_min=0.0,
        range_max=cutoff if cutoff > 0 else 2.0 * float(model.stat.extent),
    )
    rays = Body(name=ring.body, parent=name, position=(0.0, 0.0, z) if is_ring else (x, y, z), orientation=turn)
    return RangeSense(ring, rays, [int(model.sensor_adr[sensors[each]]) for each in chosen])


def _turned(direction: Array) -> tuple[float, float, float, float]:
    """Return the shortest turn that takes x to `direction`, which has length 1."""
    x, y, z = (float(part) for part in direction)
    if x < -1 + 1e-9:
        return (0.0, 0.0, 0.0, 1.0)  # half a turn about z
    w = math.sqrt((1 + x) / 2)
    return (w, 0.0, -z / (2 * w), y / (2 * w))


def _sensors(model: Any, kind: int) -> list[int]:
    return [number for number in range(model.nsensor) if model.sensor_type[number] == kind]


def _guess(model: Any) -> float:
    """Return a full scale for sensors without a range: half the weight of all bodies."""
    return max(0.5 * float(model.body_mass[1:].sum()) * GRAVITY, LEAST_FORCE) if model.nbody > 1 else 1.0
