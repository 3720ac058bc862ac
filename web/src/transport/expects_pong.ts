import { isRecord } from "../protocol/schema_check";

/** Whether the console answers this message of ours with a pong: a ping, alone or in a report. */
export function expectsPong(text: string): boolean {
  const message: unknown = JSON.parse(text);
  return isRecord(message) && (message["type"] === "ping" || typeof message["ping"] === "number");
}
