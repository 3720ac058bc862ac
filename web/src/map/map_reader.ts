import { isRecord, misfit, type Definitions } from "../protocol/schema_check";
import type { Navigation } from "../protocol/wire";
import schema from "../protocol/wire_schema_later.json";

const definitions: Definitions = schema;

/** Reads where the robot is on its map; null for anything else. */
export function readNavigation(value: unknown): Navigation | null {
  if (!isRecord(value) || misfit(definitions, "Navigation", value) !== null) return null;
  return value as unknown as Navigation; // the schema is generated together with the type
}
