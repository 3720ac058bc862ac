import { ConsoleError } from "../signalling/console_api";
import type { WhepSession } from "../signalling/whep_session";
import { USUAL_CAMERAS, USUAL_MICROPHONES, type PendingConnection } from "./pending_connection";
import { answerOf, type Preconnection } from "./preconnection";

/** What a connection is for. */
export type Purpose =
  | { readonly kind: "first"; readonly first: Preconnection } // goes on with what the page's first script has begun
  | { readonly kind: "media"; readonly voice: boolean } // all pictures and sound; `voice`: this person's too
  | { readonly kind: "thumbnail" } // one small picture
  | { readonly kind: "beside"; readonly relay: string }; // messages alone, beside the relay that media come from

/** Exchanges offer and answer. Returns how long the answer took, in ms, when it is set. Raises ConsoleError. */
export async function negotiate(
  session: WhepSession,
  pending: PendingConnection,
  purpose: Purpose,
  signal: AbortSignal,
): Promise<number> {
  switch (purpose.kind) {
    case "first": {
      const { first } = purpose;
      signal.addEventListener("abort", () => first.abort.abort());
      return await withMoreSections(session, pending, signal, async () => {
        const { answer, tookMs } = await answerOf(first);
        session.begin(answer);
        return tookMs;
      });
    }
    case "media":
      pending.addSections(USUAL_CAMERAS, USUAL_MICROPHONES);
      if (purpose.voice) pending.addVoice();
      return await withMoreSections(session, pending, signal, () =>
        exchange(session, pending, "sections=all", signal),
      );
    case "thumbnail":
      pending.addSections(1, 0); // nothing has to be asked first: a robot has a first camera or none
      return await exchange(session, pending, "view=thumbnail", signal);
    case "beside":
      return await exchange(session, pending, `relay=${encodeURIComponent(purpose.relay)}`, signal);
  }
}

/** Most robots have no more streams than are offered at first; a console with more says so instead of an answer. */
async function withMoreSections(
  session: WhepSession,
  pending: PendingConnection,
  signal: AbortSignal,
  connect: () => Promise<number>,
): Promise<number> {
  try {
    return await connect();
  } catch (error) {
    if (!(error instanceof ConsoleError) || error.error !== "too_few_sections") throw error;
    const media = await session.media(signal);
    const more = [media.cameras - USUAL_CAMERAS, media.microphones - USUAL_MICROPHONES] as const;
    pending.addSections(Math.max(0, more[0]), Math.max(0, more[1]));
    return await exchange(session, pending, "", signal);
  }
}

/** `query`: of the URL, besides what the offer itself needs. */
async function exchange(
  session: WhepSession,
  pending: PendingConnection,
  query: string,
  signal: AbortSignal,
): Promise<number> {
  const offer = await pending.offer();
  const queries = [query, offer.query].filter((each) => each !== "").join("&");
  const { answer, tookMs } = await session.offer(offer.sdp, queries, signal);
  await pending.take(answer);
  return tookMs;
}
