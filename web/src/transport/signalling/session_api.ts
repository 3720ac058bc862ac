import { parseAudit, type AuditPage } from "../../session/audit_trail";
import {
  parseInvitations,
  parseNewInvitation,
  type Invitation,
  type NewInvitation,
} from "../../session/invitations";
import type { Role } from "../../session/seat/seat_status";
import { ConsoleError, type ConsoleApi } from "./console_api";

const LIMIT_MS = 8000;
/** Of the audit trail in one answer, the most that the console gives. */
export const AUDIT_LINES = 500;

/** Invitations and the audit trail over HTTP. All of it raises ConsoleError. */
export class SessionApi {
  constructor(private readonly api: ConsoleApi) {}

  async invitations(): Promise<Invitation[]> {
    return parseInvitations(await this.ask("GET", "/api/invitations"));
  }

  async invite(role: Role, name: string, seconds: number): Promise<NewInvitation> {
    const found = parseNewInvitation(await this.ask("POST", "/api/invitations", { role, name, seconds }));
    if (found === null) throw new ConsoleError(200, "malformed", "the console's answer has no link", null);
    return found;
  }

  async revoke(id: string): Promise<void> {
    await this.ask("DELETE", `/api/invitations/${encodeURIComponent(id)}`);
  }

  /** The first lines after number `after`; the newest ones for -1. */
  async audit(after: number): Promise<AuditPage> {
    return parseAudit(await this.ask("GET", `/api/audit?after=${after}&limit=${AUDIT_LINES}`));
  }

  /** The last lines in front of number `before`, of those that the console keeps at hand. */
  async olderAudit(before: number): Promise<AuditPage> {
    return parseAudit(await this.ask("GET", `/api/audit?before=${before}&limit=${AUDIT_LINES}`));
  }

  /** Starts or ends the recording of the session; the new state comes to everyone as a message. */
  async record(start: boolean): Promise<void> {
    await this.ask("POST", start ? "/api/recordings" : "/api/recordings/stop");
  }

  private ask(method: string, path: string, body?: object): Promise<unknown> {
    return this.api.json(method, path, body, AbortSignal.timeout(LIMIT_MS));
  }
}

/** What somebody can do about an error of the two. */
export function requestErrorLabel(error: unknown): string {
  if (!(error instanceof ConsoleError)) return "The page could not do this. Reload it and try again.";
  if (error.status === 0) return "The console does not answer. Check the connection and try again.";
  if (error.status === 401) return "Your own link is no longer valid. Ask for a new one.";
  if (error.status === 403) return `Your link does not permit this: ${error.detail}.`;
  if (error.status === 404) return "The console no longer has this.";
  if (error.status === 429) return "Too many requests at once. Wait a moment and try again.";
  return `The console refused: ${error.detail || error.error}.`;
}
