import type { PageLink } from "../../util/url_fragment";
import { ConsoleError } from "../signalling/http";
import { PendingConnection, USUAL_CAMERAS, USUAL_MICROPHONES } from "./pending_connection";
import type { StampReader } from "../encoded_transform/stamp_reader";
import { postOffer, type WhepAnswer } from "../signalling/whep";

/** A connection that the page's first script has begun, for the rest of the page to go on with. */
export interface Preconnection {
  readonly pending: PendingConnection;
  readonly abort: AbortController; // of the request
  readonly posted: Promise<void>; // the offer is on its way, or never will be
  readonly outcome: Promise<Outcome>;
}

/** The two scripts have each their own classes of errors, so this is none. */
type Outcome =
  | { readonly kind: "answered"; readonly answer: WhepAnswer; readonly tookMs: number }
  | { readonly kind: "refused"; readonly refusal: Refusal }
  | { readonly kind: "failed"; readonly detail: string };

type Refusal = Pick<ConsoleError, "status" | "error" | "detail" | "retryAfterMs">;

declare global {
  interface Window {
    lockstepFirst?: Preconnection;
    lockstepReader?: () => StampReader | null; // the first script has the worker: nobody loads it twice
  }
}

const LIMIT_MS = 20_000;

/** Makes the offer and posts it. Raises Error where there is no WebRTC. */
export function preconnect(link: PageLink, token: string, reader: StampReader | null): Preconnection {
  const pending = new PendingConnection(reader, link);
  pending.addSections(USUAL_CAMERAS, USUAL_MICROPHONES);
  pending.addVoice();
  const abort = new AbortController();
  const signal = AbortSignal.any([abort.signal, AbortSignal.timeout(LIMIT_MS)]);
  const asked = post(pending, token, signal);
  const outcome = asked.then((asked) => taken(pending, asked)).catch(outcomeOf);
  const posted = asked.then(
    () => undefined,
    () => undefined,
  );
  return { pending, abort, posted, outcome };
}

/** A reader of stamps, of a page whose first script has begun no connection. */
export function firstReader(): StampReader | null {
  return window.lockstepReader?.() ?? null;
}

/** What the first script has begun, if it has and nobody has taken it yet. */
export function takePreconnection(): Preconnection | null {
  const first = window.lockstepFirst ?? null;
  delete window.lockstepFirst;
  return first;
}

/** Raises ConsoleError when the console refused. */
export async function answerOf(first: Preconnection): Promise<{ answer: WhepAnswer; tookMs: number }> {
  const outcome = await first.outcome;
  if (outcome.kind === "answered") return outcome;
  if (outcome.kind === "failed") throw new Error(outcome.detail);
  const { status, error, detail, retryAfterMs } = outcome.refusal;
  throw new ConsoleError(status, error, detail, retryAfterMs);
}

interface Asked {
  readonly answer: Promise<WhepAnswer>;
  readonly atMs: number;
}

async function post(pending: PendingConnection, token: string, signal: AbortSignal): Promise<Asked> {
  const { sdp, query } = await pending.offer();
  const address = new URL("whep?sections=all" + (query === "" ? "" : `&${query}`), document.baseURI);
  return { answer: postOffer(token, address.href, sdp, signal), atMs: performance.now() };
}

async function taken(pending: PendingConnection, asked: Asked): Promise<Outcome> {
  const answer = await asked.answer;
  const tookMs = performance.now() - asked.atMs;
  await pending.take(answer);
  return { kind: "answered", answer, tookMs };
}

function outcomeOf(error: unknown): Outcome {
  if (error instanceof ConsoleError) return { kind: "refused", refusal: error };
  return { kind: "failed", detail: error instanceof Error ? error.message : "" };
}
