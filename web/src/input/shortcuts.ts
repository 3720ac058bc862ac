import type { RobotDescription } from "../protocol/wire";

/** What a key does to the page, wherever it is not one that drives. */
export type PageAction = "charts" | "frames" | "freeze" | "keys" | "pads" | "save";

const ACTIONS: ReadonlyMap<string, PageAction> = new Map([
  ["KeyC", "charts"],
  ["KeyF", "freeze"],
  ["KeyP", "frames"],
  ["KeyX", "save"],
  ["KeyH", "keys"],
  ["KeyG", "pads"],
]);

/** The action of a key; null when there is none, or the key drives this robot and the page is armed. */
export function pageAction(
  code: string,
  armed: boolean,
  description: RobotDescription | null,
): PageAction | null {
  const action = ACTIONS.get(code);
  if (action === undefined || (armed && drivingKeys(description).has(code))) return null;
  return action;
}

/** Every key that some layer of the robot takes. */
export function drivingKeys(description: RobotDescription | null): ReadonlySet<string> {
  const bindings = description?.layers.flatMap((layer) => layer.bindings) ?? [];
  return new Set(bindings.flatMap((binding) => [binding.key_positive, binding.key_negative]));
}

/** A key as it is printed on keyboards. */
export function keyName(code: string): string {
  const arrow = { ArrowUp: "↑", ArrowDown: "↓", ArrowLeft: "←", ArrowRight: "→" }[code];
  return arrow ?? code.replace(/^(Key|Digit)/, "").replace(/([a-z])([A-Z])/g, "$1 $2");
}
