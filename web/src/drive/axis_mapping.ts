import type { Axis, Binding, ControlLayer } from "../protocol/wire";
import type { PadInputs } from "../gamepad/mapping";

export type TouchInput = NonNullable<Binding["touch"]>;
export type TouchInputs = Readonly<Record<TouchInput, number>>; // -1 to 1; right and up are positive

/** Sliders of goal axes that are held; by the axes' names. */
export interface SliderInputs {
  readonly travels: Readonly<Record<string, number>>; // since it was taken, as a share of the axis' range
  readonly pushes: Readonly<Record<string, number>>; // by the arrow keys: -1 or 1
}

/** Everything an operator holds at one moment. */
export interface HeldInputs {
  readonly pad: PadInputs | null;
  readonly keys: ReadonlySet<string>; // KeyboardEvent.code
  readonly touch: TouchInputs | null;
  readonly sliders?: SliderInputs | null;
}

/** One value per axis, in its unit; null for goal axes, which are not driven by a rate. `scale` (0 to 1) slows down. */
export function axisValues(
  axes: readonly Axis[],
  layer: ControlLayer | undefined,
  held: HeldInputs,
  scale: number,
): (number | null)[] {
  return axes.map((axis) =>
    axis.kind === "goal" ? null : valueOf(axis, inputFor(axis, layer, held) * scale),
  );
}

/** Of all that is bound to an axis: -1 to 1. */
export function inputFor(axis: Axis, layer: ControlLayer | undefined, held: HeldInputs): number {
  const bindings = layer?.bindings.filter((binding) => binding.axis === axis.name) ?? [];
  return clamp(
    bindings.reduce((sum, binding) => sum + binding.scale * inputOf(binding, held), 0),
    -1,
    1,
  );
}

/** What moves nothing. */
export function neutralValues(axes: readonly Axis[]): (number | null)[] {
  return axes.map((axis) => (axis.kind === "goal" ? null : axis.rest));
}

function inputOf(binding: Binding, held: HeldInputs): number {
  const pad = binding.pad !== null && held.pad !== null ? held.pad[binding.pad] : 0;
  const touch = binding.touch !== null && held.touch !== null ? held.touch[binding.touch] : 0;
  const keys = keyOf(held, binding.key_positive) - keyOf(held, binding.key_negative);
  const sum = (binding.invert_pad ? -pad : pad) + (binding.invert_touch ? -touch : touch) + keys;
  return clamp(sum, -1, 1);
}

/** An empty name binds nothing; some virtual keyboards send keys without a name. */
function keyOf(held: HeldInputs, code: string): number {
  return Number(code !== "" && held.keys.has(code));
}

function valueOf(axis: Axis, input: number): number {
  if (!Number.isFinite(input) || input === 0) return axis.rest;
  const reach = input > 0 ? axis.maximum - axis.rest : axis.rest - axis.minimum;
  return clamp(axis.rest + input * reach, axis.minimum, axis.maximum);
}

function clamp(value: number, minimum: number, maximum: number): number {
  return Math.min(maximum, Math.max(minimum, value));
}
