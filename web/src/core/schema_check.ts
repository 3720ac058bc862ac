/** The part of JSON Schema that the generated console schema uses. */
export interface SchemaNode {
  readonly $ref?: string;
  readonly type?: string;
  readonly enum?: readonly unknown[];
  readonly anyOf?: readonly SchemaNode[];
  readonly oneOf?: readonly SchemaNode[];
  readonly properties?: Readonly<Record<string, SchemaNode>>;
  readonly required?: readonly string[];
  readonly items?: SchemaNode | boolean;
  readonly prefixItems?: readonly SchemaNode[];
  readonly minimum?: number;
  readonly maximum?: number;
}

export type SchemaDefinitions = Readonly<Record<string, SchemaNode>>;

/** What is wrong with `value`, with its path; null when it fits. */
export function misfit(
  definitions: SchemaDefinitions,
  node: SchemaNode,
  value: unknown,
  path = "message",
): string | null {
  if (node.$ref !== undefined) {
    const target = definitions[node.$ref.slice("#/$defs/".length)];
    return target === undefined ? `${path}: unknown schema` : misfit(definitions, target, value, path);
  }
  const union = node.anyOf ?? node.oneOf;
  if (union !== undefined) {
    const fits = union.some((member) => misfit(definitions, member, value, path) === null);
    return fits ? null : `${path}: none of the kinds`;
  }
  if (node.enum !== undefined) return node.enum.includes(value) ? null : `${path}: not one of the values`;
  if (!hasType(node.type, value)) return `${path}: not ${node.type ?? "known"}`;
  if (typeof value === "number") return isWithin(node, value) ? null : `${path}: out of range`;
  if (Array.isArray(value)) return misfitOfItems(definitions, node, value, path);
  if (isRecord(value)) return misfitOfFields(definitions, node, value, path);
  return null;
}

export function isRecord(value: unknown): value is Record<string, unknown> {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}

function hasType(type: string | undefined, value: unknown): boolean {
  if (type === "array") return Array.isArray(value);
  if (type === "object") return isRecord(value);
  if (type === "null") return value === null;
  if (type === "integer") return Number.isInteger(value);
  return typeof value === type;
}

function isWithin(node: SchemaNode, value: number): boolean {
  return value >= (node.minimum ?? -Infinity) && value <= (node.maximum ?? Infinity);
}

function misfitOfItems(
  definitions: SchemaDefinitions,
  node: SchemaNode,
  items: readonly unknown[],
  path: string,
): string | null {
  if (node.prefixItems !== undefined && node.prefixItems.length !== items.length)
    return `${path}: wrong length`;
  for (const [index, item] of items.entries()) {
    const schema = node.prefixItems?.[index] ?? node.items;
    const found = typeof schema === "object" ? misfit(definitions, schema, item, `${path}[${index}]`) : null;
    if (found !== null) return found;
  }
  return null;
}

function misfitOfFields(
  definitions: SchemaDefinitions,
  node: SchemaNode,
  fields: Record<string, unknown>,
  path: string,
): string | null {
  const missing = node.required?.find((name) => !(name in fields));
  if (missing !== undefined) return `${path}.${missing}: missing`;
  for (const [name, schema] of Object.entries(node.properties ?? {})) {
    const found = name in fields ? misfit(definitions, schema, fields[name], `${path}.${name}`) : null;
    if (found !== null) return found;
  }
  return null;
}
