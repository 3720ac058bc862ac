import { isRecord } from "../../protocol/schema_check";

/** A STUN or TURN server, as RTCPeerConnection takes it. */
export interface IceServer {
  readonly urls: readonly string[];
  readonly username?: string;
  readonly credential?: string;
}

const LIMIT = 8; // more only slow the search down
const URL_START = /^(stun|turn)s?:/;
const LINK = /<([^<>]*)>((?:\s*;\s*[\w-]+="[^"]*")*)/g; // RFC 8288 3, with all values quoted, as the console does
const PARAMETER = /([\w-]+)="([^"]*)"/g;

/** The servers in the console's answer (`GET /api/ice`); what a browser would refuse is left out. */
export function parseIceServers(answer: unknown): IceServer[] {
  const listed = isRecord(answer) ? answer["ice_servers"] : undefined;
  return Array.isArray(listed) ? listed.flatMap(parseServer).slice(0, LIMIT) : [];
}

/** The same from the Link headers of an answer to an offer (RFC 9725 4.6). */
export function iceServersOf(links: string): IceServer[] {
  const found = [...links.matchAll(LINK)].map(([, url = "", parameters = ""]) => {
    const named = new Map(
      [...parameters.matchAll(PARAMETER)].map(([, name = "", value = ""]) => [name, value]),
    );
    return named.get("rel") === "ice-server"
      ? { urls: [url], username: named.get("username"), credential: named.get("credential") }
      : null;
  });
  return found.flatMap(parseServer).slice(0, LIMIT);
}

/** Whether a TURN server is among them. */
export function hasTurn(servers: readonly IceServer[]): boolean {
  return servers.some((server) => server.urls.some((url) => url.startsWith("turn")));
}

function parseServer(server: unknown): IceServer[] {
  if (!isRecord(server)) return [];
  const { urls: given, username, credential } = server;
  const urls = (Array.isArray(given) ? given : [given]).filter(
    (url): url is string => typeof url === "string" && URL_START.test(url),
  );
  if (urls.length === 0) return [];
  if (typeof username === "string" && typeof credential === "string") return [{ urls, username, credential }];
  // Without credentials a browser takes no TURN server at all.
  return urls.some((url) => url.startsWith("turn")) ? [] : [{ urls }];
}
