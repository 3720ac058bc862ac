import type { Axis, Binding, ControlLayer } from "../protocol/wire";
import type { PadInputs } from "../gamepad/mapping";

export type TouchInput = NonNullable<Binding["touch"]>;
export type TouchInputs = Readonly<Record<TouchInput, number>>; // -1 to 1; right and up are positive

/** Everything an operator holds at one moment. */
export interface HeldInputs {
  readonly pad: PadInputs | null;
  readonly keys: ReadonlySet<string>; // KeyboardEvent.code
  readonly touch: TouchInputs | null;
}

/** One value per axis, in its unit. `scale` (0 to 1) slows everything down. */
export function axisValues(
  axes: readonly Axis[],
  layer: ControlLayer | undefined,
  held: HeldInputs,
  scale: number,
): number[] {
  return axes.map((axis) => {
    const bindings = layer?.bindings.filter((binding) => binding.axis === axis.name) ?? [];
    const input = bindings.reduce((sum, binding) => sum + binding.scale * inputOf(binding, held), 0);
    return valueOf(axis, clamp(input, -1, 1) * scale);
  });
}

export function restValues(axes: readonly Axis[]): number[] {
  return axes.map((axis) => axis.rest);
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
