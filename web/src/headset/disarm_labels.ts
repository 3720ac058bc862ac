import type { HeadsetDisarmReason } from "../drive/arming";

export const HEADSET_DISARM_LABELS: Readonly<Record<HeadsetDisarmReason, string>> = {
  squeeze_released: "Squeeze the grip to drive",
  tracking_lost: "Disarmed: the headset lost sight of the hand",
  headset_off: "Disarmed: the headset was taken off",
  headset_blurred: "Disarmed: the headset showed something else",
  headset_silent: "Disarmed: the headset stood still",
  headset_left: "Disarmed: the headset view was closed",
  battery_low: "Disarmed: the battery is almost empty",
};
