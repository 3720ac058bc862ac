/** What the page is told of a relay, and what a Janus says. No I/O. */
import type { StreamInfo } from "../protocol/wire";
import { isRecord } from "../protocol/schema_check";

/** Where an observer watches instead of at the console (GET /api/relay). */
export interface SfuTicket {
  readonly engine: "janus";
  readonly relay: string;
  readonly url: string; // WebSocket
  readonly room: number;
  readonly pin: string; // lets in; "" in the first answer, which only says where
  readonly feed: number; // the publisher; another one with every publication
  readonly streams: readonly StreamInfo[]; // `mid` is the publisher's
}

/** One message of a Janus. */
export interface JanusMessage {
  readonly kind: "ack" | "answer" | "error" | "ended" | "other";
  readonly transaction: string;
  readonly data: Readonly<Record<string, unknown>>;
  readonly sdp: string | null;
  readonly detail: string;
}

const ENDED = ["hangup", "detached", "timeout"];

/** The ticket in the console's answer; null: watch at the console. */
export function parseRelayAnswer(answer: unknown): SfuTicket | null {
  const found = isRecord(answer) ? answer["relay"] : null;
  if (!isRecord(found)) return null;
  const { engine, relay, url, room, pin, feed, streams: listed } = found;
  if (engine !== "janus" || typeof relay !== "string" || typeof url !== "string") return null;
  if (typeof room !== "number" || typeof pin !== "string" || typeof feed !== "number") return null;
  const streams = Array.isArray(listed) ? listed.filter(isStream) : [];
  return { engine, relay, url, room, pin, feed, streams };
}

function isStream(value: unknown): value is StreamInfo {
  if (!isRecord(value)) return false;
  const texts = ["mid", "stream", "label", "codec"].every((name) => typeof value[name] === "string");
  return texts && (value["kind"] === "video" || value["kind"] === "audio") && value["carrier"] === "trailer";
}

/** The mids that one asks for: pictures and sound as named, and the feedback behind them. */
export function wantedMids(ticket: SfuTicket): string[] {
  return [...ticket.streams.map((stream) => stream.mid), String(ticket.streams.length)];
}

export function parseJanus(text: unknown): JanusMessage | null {
  let message: unknown;
  try {
    message = typeof text === "string" ? JSON.parse(text) : null;
  } catch {
    return null;
  }
  if (!isRecord(message) || typeof message["janus"] !== "string") return null;
  const said = message["janus"];
  const plugin = isRecord(message["plugindata"]) ? message["plugindata"]["data"] : message["data"];
  const data = isRecord(plugin) ? plugin : {};
  const jsep = message["jsep"];
  const sdp = isRecord(jsep) && typeof jsep["sdp"] === "string" ? jsep["sdp"] : null;
  const transaction = typeof message["transaction"] === "string" ? message["transaction"] : "";
  const problem = isRecord(message["error"]) ? message["error"]["reason"] : data["error"];
  const detail = typeof problem === "string" ? problem : said;
  return { kind: kindOf(said, data), transaction, data, sdp, detail };
}

function kindOf(said: string, data: Readonly<Record<string, unknown>>): JanusMessage["kind"] {
  if (said === "error" || "error_code" in data) return "error";
  if (ENDED.includes(said)) return "ended";
  if (said === "ack") return "ack";
  return said === "success" || said === "event" ? "answer" : "other";
}

/** Janus names no H.264 format when the feed came from another Janus; the browser needs one to take FU-A packets. */
export function completeOffer(sdp: string): string {
  return sdp.replace(/^a=rtpmap:(\d+) H264\/90000\r?$/gm, (line, type: string) =>
    sdp.includes(`a=fmtp:${type} `)
      ? line
      : `${line.trimEnd()}\r\na=fmtp:${type} profile-level-id=42e01f;packetization-mode=1\r`,
  );
}

/** By the offer's own mid: the publisher's mid of the same stream. */
export function feedMids(data: Readonly<Record<string, unknown>>): Map<string, string> {
  const streams = data["streams"];
  const found = new Map<string, string>();
  for (const each of Array.isArray(streams) ? streams : [])
    if (isRecord(each) && typeof each["mid"] === "string" && typeof each["feed_mid"] === "string")
      found.set(each["mid"], each["feed_mid"]);
  return found;
}
