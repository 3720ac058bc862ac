"""Decides which effects a stick plays: the contact force on its way to what is measured, a spring, a damper. No I/O."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

from lockstep.client.force_feedback.stick_force import NO_FORCE, StickForce, ramped

__all__ = ["Effect", "EffectCore", "EffectKind", "ForceSettings", "Order", "Play", "Stop", "Upload"]

EffectKind = Literal["constant", "spring", "damper"]

LONGEST = 0.25  # s that an effect lasts, at most
RENEWED_AFTER = 0.4  # of an effect's duration
GROWTH = 0.2  # s from nothing to the strongest
FALL = 0.05
FIRST_STEP = 0.02  # s
LONGEST_STEP = 0.1
FELT = 0.004  # of the device's strongest: below it there is no force
DEGREES = 2.0  # a change of direction that is told


@dataclass(frozen=True)
class ForceSettings:
    """How a stick pushes: shares of what the device can do, 0 to 1.

    Raises:
        ValueError: a share is not within 0 to 1.
    """

    strongest: float = 0.2  # no contact is felt more strongly
    spring: float = 0.15  # towards the middle, while driving
    damper: float = 0.1  # against motion, while driving
    turned: bool = False  # for a stick that pushes the wrong way

    def __post_init__(self) -> None:
        for name in ("strongest", "spring", "damper"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"{name} must be within 0 to 1")


class Effect(NamedTuple):
    """The parameters of one effect. It ends after `seconds` without an order."""

    kind: EffectKind
    share: float  # 0 to 1 of the device's strongest
    degrees: float  # of a constant force: where it comes from, clockwise from ahead
    seconds: float


class Upload(NamedTuple):
    effect: Effect


class Play(NamedTuple):
    kind: EffectKind


class Stop(NamedTuple):
    kind: EffectKind


Order = Upload | Play | Stop


class EffectCore:
    """Call `step` at least every 0.1 s, `stop` when nothing may be felt, and carry out the orders in their order.

    Every effect is finite and renewed, so that nothing pushes for a program that has ended or hangs.
    """

    def __init__(self, settings: ForceSettings, kinds: frozenset[EffectKind]) -> None:
        """`kinds`: the effects that the device has; it needs the constant force."""
        self._settings = settings
        self._kinds = kinds
        self._force = NO_FORCE
        self._stepped: float | None = None
        self._playing: dict[EffectKind, float] = {}  # when each was begun
        self._told: dict[EffectKind, Effect] = {}

    @property
    def plays(self) -> bool:
        """True if the device may be pushing."""
        return bool(self._playing)

    def step(self, force: StickForce, hold: float, now: float) -> list[Order]:
        """Return what to tell the device while `force` is to be felt.

        Args:
            force: share of the strongest that the settings allow; a longer one is cut
            hold: s, of the robot: no effect lasts longer
            now: s, monotonic
        """
        if not hold > 0:
            return self.stop()
        seconds = min(LONGEST, hold)
        passed = FIRST_STEP if self._stepped is None else now - self._stepped
        self._stepped = now
        share = self._settings.strongest * max(0.0, min(LONGEST_STEP, passed))
        goal = force.scaled(self._settings.strongest / max(1.0, force.size))
        self._force = ramped(self._force, goal, share / GROWTH, share / FALL)
        orders = self._push(seconds, now)
        for effect in (
            Effect("spring", self._settings.spring, 0.0, seconds),
            Effect("damper", self._settings.damper, 0.0, seconds),
        ):
            orders += self._keep(effect, effect.share > 0, now)
        return orders

    def stop(self) -> list[Order]:
        """Return what ends everything at once, without a ramp."""
        orders: list[Order] = [Stop(kind) for kind in self._playing]
        self._playing.clear()
        self._told.clear()  # what was decided last may not have been carried out
        self._force = NO_FORCE
        self._stepped = None
        return orders

    def _push(self, seconds: float, now: float) -> list[Order]:
        size = min(self._settings.strongest, self._force.size)
        source = self._force.source_degrees
        degrees = (source + 180) % 360 if self._settings.turned else source
        told = self._told.get("constant")
        if told is not None and abs((degrees - told.degrees + 180) % 360 - 180) < DEGREES:
            degrees = told.degrees
        return self._keep(Effect("constant", size, degrees, seconds), size >= FELT, now)

    def _keep(self, effect: Effect, wanted: bool, now: float) -> list[Order]:
        kind = effect.kind
        if not wanted or kind not in self._kinds:
            return [Stop(kind)] if self._playing.pop(kind, None) is not None else []
        orders: list[Order] = []
        told = self._told.get(kind)
        if told is None or told[2:] != effect[2:] or abs(told.share - effect.share) >= FELT:
            self._told[kind] = effect
            orders.append(Upload(effect))
        begun = self._playing.get(kind)
        if begun is None or now - begun >= RENEWED_AFTER * effect.seconds:
            self._playing[kind] = now
            orders.append(Play(kind))
        return orders
