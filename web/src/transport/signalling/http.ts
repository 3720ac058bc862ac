/** One request to the console. */
import { isRecord } from "../../protocol/schema_check";

/** What the console said instead of doing what it was asked. */
export class ConsoleError extends Error {
  constructor(
    readonly status: number, // 0: it could not be reached
    readonly error: string, // stable name
    readonly detail: string,
    readonly retryAfterMs: number | null,
  ) {
    super(detail === "" ? error : `${error}: ${detail}`);
  }
}

/** With the bearer's token. Raises ConsoleError when the console cannot be reached or refuses. */
export async function request(token: string, address: string, init: RequestInit): Promise<Response> {
  let response: Response;
  try {
    const headers = { ...(init.headers as Record<string, string>), Authorization: `Bearer ${token}` };
    response = await fetch(address, { ...init, headers, cache: "no-store" });
  } catch (error) {
    throw new ConsoleError(0, "console_unreachable", error instanceof Error ? error.message : "", null);
  }
  if (!response.ok) throw await errorOf(response);
  return response;
}

async function errorOf(response: Response): Promise<ConsoleError> {
  const body: unknown = await response.json().catch(() => null);
  const field = (name: string): string => {
    const value = isRecord(body) ? body[name] : undefined;
    return typeof value === "string" ? value : "";
  };
  const retryAfter = Number(response.headers.get("Retry-After") ?? NaN);
  return new ConsoleError(
    response.status,
    field("error") || `http_${response.status}`,
    field("detail"),
    Number.isFinite(retryAfter) ? retryAfter * 1000 : null,
  );
}
