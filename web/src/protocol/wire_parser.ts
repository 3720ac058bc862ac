import type { RobotDescription, ServerMessage } from "./wire";
import schema from "./wire_schema.json";
import { isRecord, misfit, type Definitions, type Shape } from "./schema_check";

/** A message of the console protocol, or why the text is none. */
export type Parsed =
  | { readonly kind: "message"; readonly message: ServerMessage }
  | { readonly kind: "unknown"; readonly type: string; readonly value: unknown }
  | { readonly kind: "malformed"; readonly detail: string };

const definitions: Definitions = schema;
const MAX_LENGTH = 1_000_000;

const nameByType = namesByType(definitions);

/** The names of the messages' definitions, by the value of their field `type`. */
export function namesByType(from: Definitions): ReadonlyMap<string, string> {
  return new Map(
    Object.entries(from).flatMap(([name, shape]) => typesOf(shape).map((type) => [type, name] as const)),
  );
}

/** The values of the field `type` of a message. */
function typesOf(shape: Shape): readonly string[] {
  const type = typeof shape === "object" && "fields" in shape ? shape.fields["type"] : undefined;
  return typeof type === "object" && "enum" in type ? type.enum.map(String) : [];
}

export function parseServerMessage(data: unknown): Parsed {
  if (typeof data !== "string") return { kind: "malformed", detail: "not text" };
  if (data.length > MAX_LENGTH) return { kind: "malformed", detail: "too long" };
  let value: unknown;
  try {
    value = JSON.parse(data);
  } catch {
    return { kind: "malformed", detail: "not JSON" };
  }
  if (!isRecord(value) || typeof value["type"] !== "string") return { kind: "malformed", detail: "no type" };
  return parseTyped(value, value["type"]);
}

function parseTyped(value: Record<string, unknown>, type: string): Parsed {
  const name = nameByType.get(type);
  const node = name === undefined ? undefined : definitions[name];
  if (node === undefined) return { kind: "unknown", type, value };
  const detail = misfit(definitions, node, value);
  if (detail !== null) return { kind: "malformed", detail };
  // The schema is generated together with the type, so what fits the one is the other.
  return { kind: "message", message: value as unknown as ServerMessage };
}

/** null: it is no robot description. */
export function parseDescription(value: unknown): RobotDescription | null {
  const node = definitions["RobotDescription"];
  if (node === undefined || misfit(definitions, node, value) !== null) return null;
  return value as RobotDescription; // as above
}
