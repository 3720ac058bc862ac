import type { PageLink } from "../core/fragment";
import { ConsoleError } from "./http";
import { Opening, USUAL_CAMERAS, USUAL_MICROPHONES } from "./opening";
import { newReader } from "./stamp_reader";
import { postOffer, type WhepAnswer } from "./whep";

/** A connection that the page's first script has begun, for the rest of the page to go on with. */
export interface FirstOpening {
  readonly opening: Opening;
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
    lockstepFirst?: FirstOpening;
  }
}

const LIMIT_MS = 20_000;

/** Makes the offer and posts it. Raises Error where there is no WebRTC. */
export function openFirst(link: PageLink, token: string): FirstOpening {
  const opening = new Opening(newReader(), link);
  opening.addSections(USUAL_CAMERAS, USUAL_MICROPHONES);
  opening.addVoice();
  const abort = new AbortController();
  const signal = AbortSignal.any([abort.signal, AbortSignal.timeout(LIMIT_MS)]);
  const asked = post(opening, token, signal);
  const outcome = asked.then((asked) => taken(opening, asked)).catch(outcomeOf);
  const posted = asked.then(
    () => undefined,
    () => undefined,
  );
  return { opening, abort, posted, outcome };
}

/** What the first script has begun, if it has and nobody has taken it yet. */
export function takeFirst(): FirstOpening | null {
  const first = window.lockstepFirst ?? null;
  delete window.lockstepFirst;
  return first;
}

/** Raises ConsoleError when the console refused. */
export async function answerOf(first: FirstOpening): Promise<{ answer: WhepAnswer; tookMs: number }> {
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

async function post(opening: Opening, token: string, signal: AbortSignal): Promise<Asked> {
  const { sdp, query } = await opening.offer();
  const address = new URL("whep?sections=all" + (query === "" ? "" : `&${query}`), document.baseURI);
  return { answer: postOffer(token, address.href, sdp, signal), atMs: performance.now() };
}

async function taken(opening: Opening, asked: Asked): Promise<Outcome> {
  const answer = await asked.answer;
  const tookMs = performance.now() - asked.atMs;
  await opening.take(answer);
  return { kind: "answered", answer, tookMs };
}

function outcomeOf(error: unknown): Outcome {
  if (error instanceof ConsoleError) return { kind: "refused", refusal: error };
  return { kind: "failed", detail: error instanceof Error ? error.message : "" };
}
