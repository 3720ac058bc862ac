import type { PadLayout } from "../../src/gamepad/layout";
import type { PadSnapshot } from "../../src/gamepad/mapping";

/** A pad of a test: buttons that are pressed, by number. */
export function padOf(axes: number[], pressed: number[] = [], mapping = "standard", id = "pad"): PadSnapshot {
  const buttons = Array.from({ length: 17 }, (_, index) => {
    const down = pressed.includes(index);
    return { pressed: down, value: down ? 1 : 0 };
  });
  return { id, mapping, axes, buttons };
}

/** As some browsers give a pad that they do not know: triggers are axes 2 and 5 and rest at -1, the cross is a hat. */
export const ODD_LAYOUT: PadLayout = {
  sticks: {
    left_x: { index: 0, negative: -1, rest: 0, positive: 1 },
    left_y: { index: 1, negative: 1, rest: 0, positive: -1 },
    right_x: null,
    right_y: null,
  },
  triggers: {
    left_trigger: { kind: "axis", index: 2, rest: -1, full: 1 },
    right_trigger: { kind: "axis", index: 5, rest: -1, full: 1 },
  },
  cross: {
    cross_up: { kind: "hat", index: 6, value: -1 },
    cross_right: { kind: "hat", index: 6, value: -3 / 7 },
    cross_down: { kind: "hat", index: 6, value: 1 / 7 },
    cross_left: { kind: "hat", index: 6, value: 5 / 7 },
  },
  actions: {
    deadman: [{ kind: "button", index: 4 }],
    arm: [{ kind: "button", index: 6 }],
    stop: [{ kind: "button", index: 2 }],
    slow: [],
    turbo: [],
    layer: [],
    action_1: [],
    action_2: [],
    episode: [],
  },
};
