/** An offer for an answer (draft-ietf-wish-whep). */
import { iceServersOf, type IceServer } from "./ice_servers";
import { request } from "./http";

export interface WhepAnswer {
  readonly sdp: string;
  readonly location: string; // of the session, to end it
  readonly tag: string; // entity tag of its ICE session (RFC 9725 4.3.1)
  readonly servers: readonly IceServer[]; // STUN and TURN, with credentials that are good for a while
}

/** Raises ConsoleError. */
export async function postOffer(
  token: string,
  address: string,
  sdp: string,
  signal: AbortSignal,
): Promise<WhepAnswer> {
  const headers = { "Content-Type": "application/sdp" };
  const response = await request(token, address, { method: "POST", headers, body: sdp, signal });
  const location = response.headers.get("Location");
  return {
    sdp: await response.text(),
    location: location === null ? "" : new URL(location, response.url).href,
    tag: response.headers.get("ETag") ?? "",
    servers: iceServersOf(response.headers.get("Link") ?? ""),
  };
}
