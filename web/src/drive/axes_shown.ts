import type { RobotDescription } from "../protocol/wire";

/** The axes that the page shows in a layer, by name: those that it binds, and goal axes that no layer binds; else all. */
export function axesShown(description: RobotDescription, layer: number): ReadonlySet<string> {
  const bound = (index: number): string[] =>
    description.layers[index]?.bindings.map((binding) => binding.axis) ?? [];
  const names = new Set(bound(layer));
  if (names.size === 0) return new Set(description.axes.map((axis) => axis.name));
  const anywhere = new Set(description.layers.flatMap((_, index) => bound(index)));
  for (const axis of description.axes)
    if (axis.kind === "goal" && !anywhere.has(axis.name)) names.add(axis.name);
  return names;
}
