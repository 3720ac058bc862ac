import { isRecord, misfit, type Definitions } from "../protocol/schema_check";
import type { EpisodeAnswer, EpisodeState } from "../protocol/wire";
import schema from "../protocol/wire_schema_later.json";

const definitions: Definitions = schema;

/** Reads a message about episodes; null for any other message. */
export function readEpisodeMessage(value: unknown): EpisodeState | EpisodeAnswer | null {
  if (!isRecord(value)) return null;
  const name = { episode: "EpisodeState", episode_answer: "EpisodeAnswer" }[String(value["type"])];
  if (name === undefined || misfit(definitions, name, value) !== null) return null;
  // The schema is generated together with the types.
  return value as unknown as EpisodeState | EpisodeAnswer;
}
