import { keyName } from "../../input/shortcuts";
import type { Binding } from "../../protocol/wire";

/** The input device that the operator uses. */
export type InputDevice = "keys" | "pad" | "touch";

const PAD: Readonly<Record<NonNullable<Binding["pad"]>, string>> = {
  left_x: "L ↔",
  left_y: "L ↕",
  right_x: "R ↔",
  right_y: "R ↕",
  dpad_x: "✛ ↔",
  dpad_y: "✛ ↕",
  triggers: "LT RT",
};

/** Which part of the device moves an axis, short: the pad's sticks, or the keys for less and more. "": none does. */
export function inputHint(binding: Binding | undefined, device: InputDevice): string {
  if (binding === undefined) return "";
  const part = device === "pad" ? binding.pad : device === "touch" ? binding.touch : null;
  if (part !== null) return PAD[part];
  if (device !== "keys") return "";
  const keys = [binding.key_negative, binding.key_positive].filter((code) => code !== "");
  return keys.map(keyName).join(" ");
}
