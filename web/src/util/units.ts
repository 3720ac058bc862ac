/** How quantities of one kind are written, chosen once by how large they get. */
export interface Scale {
  readonly unit: string; // "µm/s"
  readonly factor: number; // what a value in the described unit is multiplied with
  readonly digits: number; // behind the point
}

const PREFIXES = [
  { prefix: "", factor: 1 },
  { prefix: "m", factor: 1e3 },
  { prefix: "µ", factor: 1e6 },
] as const;
const SMALLEST = { prefix: "n", factor: 1e9 } as const;
/** Units that begin with metre or newton take a prefix: "m", "m/s", "N m". */
const PREFIXED = /^(m|N)(?=$|[/ ·²])/;
/** Below this a quantity is written in smaller units: 0.25 m/s stays, 0.05 m/s is 50 mm/s. */
const TOO_SMALL = 0.1;

/** The unit and the digits for quantities of up to `magnitude` (in `unit`). */
export function scaleFor(unit: string, magnitude: number): Scale {
  const size = Math.abs(magnitude);
  if (!Number.isFinite(size) || size === 0) return { unit, factor: 1, digits: 2 };
  if (size >= TOO_SMALL || !PREFIXED.test(unit)) return { unit, factor: 1, digits: digitsFor(size) };
  const { prefix, factor } = PREFIXES.find((each) => size * each.factor >= 1) ?? SMALLEST;
  return { unit: prefix + unit, factor, digits: digitsFor(size * factor) };
}

/** "12.5 µm/s"; never "-0.0". */
export function quantity(value: number, { unit, factor, digits }: Scale): string {
  const text = (value * factor).toFixed(digits);
  return `${/[1-9]/.test(text) ? text : text.replace("-", "")} ${unit}`;
}

/** The longest of 1, 2, 5, 10 … that is not longer than `most`; 0 when there is none. */
export function roundLength(most: number): number {
  if (!(most > 0) || !Number.isFinite(most)) return 0;
  const decade = 10 ** Math.floor(Math.log10(most));
  const share = most / decade;
  return (share >= 5 ? 5 : share >= 2 ? 2 : 1) * decade;
}

/** "50 µm": a length without needless zeros. */
export function lengthLabel(metres: number): string {
  const { unit, factor } = scaleFor("m", metres);
  return `${Number((metres * factor).toPrecision(3))} ${unit}`;
}

function digitsFor(size: number): number {
  if (size >= 1000) return 0;
  if (size >= 10) return 1;
  return size >= 0.1 ? 2 : Math.min(9, 1 - Math.floor(Math.log10(size)));
}
