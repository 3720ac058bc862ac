/** What a value of a message has to be; scripts/generate_wire.js makes it from the console's JSON Schema. */
export type Shape =
  | string // "number", "integer", "string", "boolean", "null", or the name of a definition
  | { readonly type: string; readonly minimum?: number; readonly maximum?: number }
  | { readonly enum: readonly unknown[] }
  | { readonly any: readonly Shape[] }
  | { readonly items: Shape; readonly length?: number }
  | { readonly fields: Readonly<Record<string, Shape>>; readonly optional?: readonly string[] };

export type Definitions = Readonly<Record<string, Shape>>;

const PRIMITIVES = new Set(["number", "integer", "string", "boolean", "null"]);

/** What is wrong with `value`, with its path; null when it fits. */
export function misfit(
  definitions: Definitions,
  shape: Shape,
  value: unknown,
  path = "message",
): string | null {
  if (typeof shape === "string") {
    if (PRIMITIVES.has(shape)) return hasType(shape, value) ? null : `${path}: not ${shape}`;
    const target = definitions[shape];
    return target === undefined ? `${path}: unknown schema` : misfit(definitions, target, value, path);
  }
  if ("any" in shape) {
    const fits = shape.any.some((member) => misfit(definitions, member, value, path) === null);
    return fits ? null : `${path}: none of the kinds`;
  }
  if ("enum" in shape) return shape.enum.includes(value) ? null : `${path}: not one of the values`;
  if ("items" in shape) {
    if (!Array.isArray(value)) return `${path}: not array`;
    if (shape.length !== undefined && shape.length !== value.length) return `${path}: wrong length`;
    return firstOf(value.entries(), ([index, item]) =>
      misfit(definitions, shape.items, item, `${path}[${index}]`),
    );
  }
  if ("fields" in shape) {
    if (!isRecord(value)) return `${path}: not object`;
    return firstOf(Object.entries(shape.fields), ([name, field]) => {
      if (name in value) return misfit(definitions, field, value[name], `${path}.${name}`);
      return shape.optional?.includes(name) === true ? null : `${path}.${name}: missing`;
    });
  }
  if (!hasType(shape.type, value)) return `${path}: not ${shape.type}`;
  const { minimum = -Infinity, maximum = Infinity } = shape;
  return typeof value === "number" && (value < minimum || value > maximum) ? `${path}: out of range` : null;
}

export function isRecord(value: unknown): value is Record<string, unknown> {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}

function hasType(type: string, value: unknown): boolean {
  if (type === "null") return value === null;
  if (type === "integer") return Number.isInteger(value);
  return typeof value === type;
}

/** What `find` found first. */
function firstOf<Item>(items: Iterable<Item>, find: (item: Item) => string | null): string | null {
  for (const item of items) {
    const found = find(item);
    if (found !== null) return found;
  }
  return null;
}
