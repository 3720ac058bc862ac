import { misfit, type Definitions } from "./schema_check";
import { namesByType } from "./wire_parser";
import schema from "./wire_schema_later.json";

const definitions: Definitions = schema;
const names = namesByType(definitions);

/** What is wrong with a message of a type whose schema comes with later code; null: it fits. */
export function lateMisfit(type: string, message: unknown): string | null {
  return misfit(definitions, names.get(type) ?? type, message);
}
