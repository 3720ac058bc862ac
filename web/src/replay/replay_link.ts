import { isEvent } from "../gate/serial";

/** What a link to the recordings says behind the `#`. */
export interface ReplayLink {
  readonly token: string;
  readonly recording: string | null;
  readonly event: number | null;
}

export function readReplayLink(hash: string): ReplayLink {
  const fields = new URLSearchParams(hash.replace(/^#/, ""));
  const event = Number(fields.get("event") ?? NaN);
  return {
    token: fields.get("token") ?? "",
    recording: fields.get("recording") || null,
    event: isEvent(event) ? event : null,
  };
}

/** "#token=…&recording=…&event=12". */
export function replayHash(link: ReplayLink): string {
  const fields = new URLSearchParams();
  if (link.token !== "") fields.set("token", link.token);
  if (link.recording !== null) fields.set("recording", link.recording);
  if (link.event !== null) fields.set("event", String(link.event));
  return `#${fields}`;
}

/** The token in what somebody pastes: a whole link, or the token alone; "" when there is none. */
export function tokenIn(text: string): string {
  const pasted = text.trim();
  const at = pasted.indexOf("#");
  if (at !== -1) return readReplayLink(pasted.slice(at)).token;
  return /^[\w-]+\.[\w-]+\.[\w-]+$/.test(pasted) ? pasted : "";
}
