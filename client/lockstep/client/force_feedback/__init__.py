"""Force-feedback joysticks on Linux: the hand feels the contact force. `lockstep.client` itself does not need it."""

from lockstep.client.force_feedback.effect_core import ForceSettings
from lockstep.client.force_feedback.errors import ForceFeedbackError
from lockstep.client.force_feedback.evdev_stick import EvdevStick
from lockstep.client.force_feedback.force_feedback import ForceFeedback

__all__ = ["EvdevStick", "ForceFeedback", "ForceFeedbackError", "ForceSettings"]
